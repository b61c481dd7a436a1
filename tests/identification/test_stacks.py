"""Many causes that gain little each are a series, not an explanation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from wbc import load_robot
from wbc.effects import CoulombFriction, TorqueConstant, TorqueOffset, ViscousFriction
from wbc.identification.stacks import looks_like_a_stack
from wbc.robot import Effect

ROBOT = load_robot("planar_leg_fixed").lossless()
COULOMB = (CoulombFriction("hip", 1.0), CoulombFriction("knee", 1.0))
OTHERS = (ViscousFriction("hip", 1.0), TorqueOffset("knee", 1.0), TorqueConstant("hip", 1.1))


@dataclass
class _Selector:
    """Models whose error (rms) is that of the log times a factor per name found."""

    left: Mapping[str, float]

    problem = SimpleNamespace(robot=ROBOT)

    def model(self, effects: Sequence[Effect]) -> SimpleNamespace:
        error = 10.0
        for name in {effect.name for effect in effects}:
            error *= self.left[name]
        return SimpleNamespace(effects=tuple(effects), error=error**2)


@pytest.mark.parametrize(("little", "stack"), [(0, False), (1, False), (2, True), (3, True)])
def test_more_than_one_cause_that_gains_little_makes_a_stack(little: int, stack: bool) -> None:
    names = [e.name for e in OTHERS]
    left = {name: 0.95 if k < little else 0.6 for k, name in enumerate(names)}
    selector = _Selector(left | {"coulomb_friction": 0.3})
    assert looks_like_a_stack(selector, selector.model((*COULOMB, *OTHERS))) is stack  # type: ignore[arg-type]


def test_one_effect_in_all_gears_is_one_story() -> None:
    selector = _Selector({"coulomb_friction": 0.95, "viscous_friction": 0.95})
    both = (*COULOMB, ViscousFriction("hip", 1.0))
    assert looks_like_a_stack(selector, selector.model(COULOMB)) is False  # type: ignore[arg-type]
    assert looks_like_a_stack(selector, selector.model(both)) is False  # type: ignore[arg-type]
