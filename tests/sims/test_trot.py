"""Solo12 trots a metre on lossy gears; who knows the losses keeps speed and height."""

import pytest

from sims.trot import FELL, SPEED, TRANSPORT, main

HEIGHT = "height, rms error [mm]"


@pytest.mark.parametrize("scene", ["level", "step"])
def test_solo12_trots_a_metre_and_more_on_lossy_gears(scene):
    found = main(2.5, ["wbc.sim"], [scene], ["dissipative"])
    figures = found["wbc.sim", scene, "dissipative"]
    assert figures[FELL] == 0.0
    assert figures["refused ticks"] == 0.0
    assert figures[SPEED] == pytest.approx(0.5, abs=0.03)
    assert figures["tilt, largest [deg]"] < 2.0


def test_mujoco_agrees_that_knowing_the_losses_pays():
    found = main(2.0, ["MuJoCo"], ["level"], ["dissipative", "conservative"])
    knowing, not_knowing = found.values()
    assert knowing[FELL] == not_knowing[FELL] == 0.0
    assert knowing[SPEED] == pytest.approx(0.5, abs=0.03)
    assert not_knowing[SPEED] < 0.9 * knowing[SPEED]
    assert 5.0 * knowing[HEIGHT] < not_knowing[HEIGHT]
    assert knowing[TRANSPORT] < not_knowing[TRANSPORT]
