"""TALOS takes steps on lossy gears, forward and up 5 cm, and does not fall."""

import pytest

from sims.stepping import DONE, FELL, HEIGHT, POINT, REFUSED, TRANSPORT, WAY, main, pushed


def test_talos_takes_three_steps_forward_on_lossy_gears():
    (figures,) = main(3, ["wbc.sim"], ["forward"], ["dissipative"]).values()
    assert figures[FELL] == 0.0
    assert figures[REFUSED] == 0.0
    assert figures[DONE] == 3.0
    assert figures[WAY] == pytest.approx(2 * 0.135, abs=0.02)
    assert figures[POINT] < 5.0


def test_talos_steps_up_five_centimetres_in_mujoco():
    """One foot after the other; the height that is followed ends 5 cm above the start."""
    (figures,) = main(3, ["MuJoCo"], ["step"], ["dissipative"]).values()
    assert figures[FELL] == figures[REFUSED] == 0.0
    assert figures[DONE] == 3.0
    assert figures[POINT] < 5.0
    assert figures[HEIGHT] < 6.0
    assert 0.1 < figures[TRANSPORT] < 1.0


def test_footholds_answer_to_a_push():
    """A push of 400 N for 0.1 s, with which it falls where the footholds stay as planned."""
    answered = pushed((400.0, 0.0, 0.0), steps=4)
    assert answered[FELL] == 0.0
    assert answered[DONE] == 4
    assert answered[WAY] > 0.05  # it went along with the push
    assert pushed((400.0, 0.0, 0.0), adjusts=False, steps=4)[FELL] == 1.0
