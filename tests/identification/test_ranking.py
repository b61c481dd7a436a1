"""The ranking says what the fits said, and what each hypothesis is in words."""

from __future__ import annotations

import pytest

from wbc.identification import Ranked

EFFICIENCY, FRICTION = ("transmission_efficiency", "knee"), ("coulomb_friction", "hip")

FRICTION_FOR_EFFICIENCY = "coulomb friction at hip instead of transmission efficiency at knee"


@pytest.mark.parametrize(
    ("added", "removed", "text"),
    [
        ((), (), "what was found"),
        ((), (EFFICIENCY, FRICTION), "robot as given"),
        ((), (FRICTION,), "without coulomb friction at hip"),
        ((FRICTION,), (), "with coulomb friction at hip, too"),
        ((FRICTION,), (EFFICIENCY,), FRICTION_FOR_EFFICIENCY),
    ],
)
def test_a_hypothesis_is_named_by_what_differs(added: tuple, removed: tuple, text: str) -> None:
    row = Ranked(added, removed, 2.0, 3.0, 0.1, -20.0, "worse")
    assert row.text == text
    assert [item["effect"] for item in row.to_json()["added"]] == [name for name, _ in added]
