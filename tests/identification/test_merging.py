"""Several causes give way to the one that they imitate together, and two causes stay two."""

from __future__ import annotations

import pytest

from sims.excitation import record_with
from wbc.effects import (
    EFFECTS,
    CoulombFriction,
    LoadFriction,
    PayloadMass,
    SupplySag,
    TorqueConstant,
    TransmissionEfficiency,
    load_robot,
)
from wbc.identification.choice.merging import merged
from wbc.identification.choice.selection import Selector
from wbc.identification.model.problem import Problem
from wbc.robot import Effect

LEG = load_robot("planar_leg_fixed").lossless()


def _merged(hidden: list[Effect], named: list[Effect]) -> list[tuple[str, str]] | None:
    problem = Problem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    selector = Selector(problem, tuple(EFFECTS.values()))
    found = merged(selector, selector.model(named), selector.model(()))
    return None if found is None else [(e.name, e.where) for e in found.effects]


@pytest.mark.parametrize("beside", [[], [CoulombFriction("hip", 0.5)]], ids=["alone", "beside"])
def test_load_friction_with_a_wrong_torque_constant_is_one_lossy_gear(
    beside: list[Effect],
) -> None:
    hidden = [TransmissionEfficiency("knee", 0.8, 0.9), *beside]
    named = [LoadFriction("knee", 0.05), TorqueConstant("knee", 0.9), *beside]
    kept = [(e.name, e.where) for e in beside]
    assert _merged(hidden, named) == [*kept, ("transmission_efficiency", "knee")]


@pytest.mark.parametrize(
    "hidden",
    [
        [CoulombFriction("hip", 0.5), PayloadMass("foot", 0.3)],
        [LoadFriction("hip", 0.1), SupplySag("robot", 2e-3), TorqueConstant("knee", 0.8)],
    ],
    ids=["two", "three"],
)
def test_causes_that_no_other_explains_stay(hidden: list[Effect]) -> None:
    assert _merged(hidden, hidden) is None
