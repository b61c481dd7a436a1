"""Many causes that gain little each are a series, not an explanation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from wbc import load_robot
from wbc.effects import CoulombFriction, TorqueConstant, TorqueOffset, ViscousFriction
from wbc.identification.choice.stacks import without_little_terms
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
        return SimpleNamespace(effects=tuple(effects), error=error**2, swings=False)


@pytest.mark.parametrize("little", range(4))
def test_more_than_one_cause_that_gains_little_makes_a_stack(little: int) -> None:
    names = [e.name for e in OTHERS]
    left = {name: 0.95 if k < little else 0.6 for k, name in enumerate(names)}
    selector = _Selector(left | {"coulomb_friction": 0.3})
    whole = (*COULOMB, *OTHERS)
    main = without_little_terms(selector, selector.model(whole))  # type: ignore[arg-type]
    # A single one may be a small cause.
    wanted = {*COULOMB, *OTHERS[little:]} if little > 1 else {*whole}
    assert set(main.effects) == wanted


def test_one_effect_in_all_gears_is_one_story() -> None:
    selector = _Selector({"coulomb_friction": 0.95, "viscous_friction": 0.95})
    for effects in (COULOMB, (*COULOMB, ViscousFriction("hip", 1.0))):
        model = selector.model(effects)
        assert without_little_terms(selector, model) is model  # type: ignore[arg-type, comparison-overlap]
