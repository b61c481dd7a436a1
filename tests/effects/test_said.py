"""How an effect says its size."""

from __future__ import annotations

import pytest

from wbc.effects import CoulombFriction


@pytest.mark.parametrize(
    ("level", "said"), [(162.3, "160 N m"), (20.6, "21 N m"), (0.5012, "0.5 N m"), (1234.0, "1200")]
)
def test_a_size_of_two_digits_has_no_exponent(level: float, said: str) -> None:
    assert f"Coulomb friction of {said}" in CoulombFriction("knee", level).said()
