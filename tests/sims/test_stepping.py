"""TALOS takes four steps forward on lossy gears and does not fall."""

from __future__ import annotations

import pytest

from sims.stepping import DONE, FELL, POINT, WAY, main, pushed


def test_talos_takes_four_steps_forward_on_lossy_gears():
    (figures,) = main(4, ways=["forward"], models=["dissipative"]).values()
    assert figures[FELL] == 0.0
    assert figures["refused ticks"] == 0.0
    assert figures[DONE] == 4.0
    assert figures[WAY] == pytest.approx(3 * 0.135, abs=0.02)
    assert figures[POINT] < 5.0


def test_footholds_answer_to_a_push():
    """A push of 400 N for 0.1 s, with which it falls where the footholds stay as planned."""
    answered = pushed((400.0, 0.0, 0.0), steps=4)
    assert answered[FELL] == 0.0
    assert answered[DONE] == 4
    assert answered[WAY] > 0.05  # it went along with the push
    assert pushed((400.0, 0.0, 0.0), adjusts=False, steps=4)[FELL] == 1.0
