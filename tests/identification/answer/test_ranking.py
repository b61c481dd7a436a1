"""The ranking says what the fits said, and what each hypothesis is in words."""

from __future__ import annotations

import pytest

from wbc.identification import Ranked

EFFICIENCY, FRICTION = ("transmission_efficiency", "knee"), ("coulomb_friction", "hip")


@pytest.mark.parametrize(
    ("added", "removed", "difference", "standing", "judgement"),
    [
        ((), (), 0.0, "found", "kept"),  # it holds no effect: the robot as given
        ((FRICTION,), (), -0.1, "worse", "no gain beyond chance"),
        ((FRICTION,), (), -3.0, "worse", "fits better, but less probable"),
        ((), (FRICTION,), 3.0, "worse", "fits worse"),
        ((FRICTION,), (EFFICIENCY,), 0.1, "worse", "fits as well, but less probable"),
        ((FRICTION,), (EFFICIENCY,), 0.1, "not distinguishable", "as good"),
        ((FRICTION,), (), -3.0, "better", "more probable"),
    ],
)
def test_a_model_that_fits_equally_is_not_called_worse(
    added: tuple, removed: tuple, difference: float, standing: str, judgement: str
) -> None:
    row = Ranked(added, removed, 2.0, difference, 0.1, -5.0, standing)
    assert row.judgement == judgement
