"""TALOS takes four steps forward on lossy gears and does not fall."""

from __future__ import annotations

import pytest

from sims.stepping import DONE, FELL, POINT, WAY, main


def test_talos_takes_four_steps_forward_on_lossy_gears():
    (figures,) = main(4, ways=["forward"], models=["dissipative"]).values()
    assert figures[FELL] == 0.0
    assert figures["refused ticks"] == 0.0
    assert figures[DONE] == 4.0
    assert figures[WAY] == pytest.approx(3 * 0.135, abs=0.02)
    assert figures[POINT] < 5.0
