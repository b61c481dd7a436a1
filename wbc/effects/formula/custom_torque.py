"""A torque given by a formula: for what no effect of the catalogue describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.formula.torque_term import TorqueTerm
from wbc.effects.joint_effect import JointEffect
from wbc.errors import EffectError, unknown_name
from wbc.robot import Motion, Parameter, Robot, SearchOffer

_LARGEST = 1e9


@final
@dataclass(frozen=True)
class CustomTorque(JointEffect):
    """The torque sum_k c_k f_k on a joint, each f_k a product of quantities of the motion.

    Terms with the factor sign(v) of the joint itself are dry friction: together they give the level
    max(0, -sum_k c_k f_k / sign(v)), so that the joint sticks and never chatters, and never
    is driven by its own friction. All other terms are smooth torque; the sign of another
    joint's velocity is softened to v / sqrt(v^2 + (0.05 rad/s)^2).

    Its parameters are the coefficients; the name of each is the text of its product, such as
    `sin(2 q_hip) * sign(v_knee)`, also as an attribute. Texts are parsed, never evaluated.

    Attributes:
        terms: at least one, no product twice.
    """

    terms: tuple[TorqueTerm, ...]

    name = "custom_torque"
    parameters = ()
    explanation = (
        "A formula that fits the logs; it was found by regression and has no cause of its own."
    )
    experiment = (
        "Move only the joints in the formula, one at a time, over a wider range of position and "
        "speed than before, and see whether the formula still holds."
    )
    # None: formulas are searched for on their own, not beside named causes.
    search = SearchOffer(screens=lambda *_: ())

    def __post_init__(self) -> None:
        """Check the terms and give every coefficient its name."""
        object.__setattr__(self, "terms", tuple(self.terms))
        texts = [term.text for term in self.terms]
        if not texts:
            raise EffectError(f"{self.name} at '{self.where}' needs at least one term.")
        if len(set(texts)) < len(texts):
            raise EffectError(f"{self.name} at '{self.where}' holds a term twice.")
        for term in self.terms:
            term.check(self.where)
            object.__setattr__(self, term.text, term.coefficient)
        parameters = tuple(
            Parameter(
                name=term.text,
                unit=term.unit(),
                null=0.0,
                low=-_LARGEST,
                high=_LARGEST,
                scale=abs(term.coefficient) or 1.0,
            )
            for term in self.terms
        )
        object.__setattr__(self, "parameters", parameters)
        super().__post_init__()

    @classmethod
    def at(cls, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the effect at `where` whose terms are the keys of `values`.

        Raises:
            EffectError: a text that is no term, no term at all, or a number that is not finite.
        """
        given = (values or {}).items()
        return cls(where, tuple(TorqueTerm.parse(text, number) for text, number in given))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the same formula with some coefficients changed."""
        known = {term.text: term for term in self.terms}
        for name, value in values.items():
            if name not in known:
                raise EffectError(unknown_name(f"parameter of {self.name}", name, known))
            known[name] = replace(known[name], coefficient=float(value))
        return replace(self, terms=tuple(known.values()))

    @property
    def needs_acceleration(self) -> bool:
        """Whether it can only be compared with logs, not controlled or simulated."""
        return any(term.needs_acceleration for term in self.terms)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless every joint of the formula is a joint of `robot`."""
        super().check_place(robot)
        for term in self.terms:
            for joint in term.joints:
                if joint not in robot.single_joints:
                    place = f"joint in '{term.text}' at '{self.where}'"
                    raise EffectError(unknown_name(place, joint, robot.single_joints))
            if robot.floating_size and any(f.quantity == "load" for f in term.factors):
                raise EffectError(
                    f"the term '{term.text}' at '{self.where}' needs the load of a joint, which "
                    f"depends on contact forces on '{robot.name}'; gravity_JOINT does not."
                )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the smooth part of the formula at the joint, (..., nv) [N m]."""
        smooth = [term for term in self.terms if term.direction_of(self.where) is None]
        if not smooth:
            return None
        parts = [getattr(self, term.text) * term.value(robot, motion) for term in smooth]
        return self.on_joint(robot, motion, np.sum(parts, axis=0))

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the level of the terms with the joint's own sign(v), (..., nv) [N m], >= 0."""
        parts = []
        for term in self.terms:
            direction = term.direction_of(self.where)
            if direction is not None:
                size = term.value(robot, motion, without=direction)
                parts.append(-getattr(self, term.text) * size)
        if not parts:
            return None
        return self.on_joint(robot, motion, np.maximum(np.sum(parts, axis=0), 0.0))
