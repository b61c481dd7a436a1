"""Torques given as formulas, for what no effect of the catalogue describes."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Self, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.errors import EffectError, require_known
from wbc.robot import Motion, Parameter, Robot, SearchOffer

SOFT_SPEED = 0.05
"""Speed [rad/s, m/s] at which the softened sign of another joint's velocity is 0.7."""

# Exponents of (N m or N), s and (rad or m) in the unit of each quantity.
_DIMENSION = {
    "q": (0, 0, 1),
    "v": (0, -1, 1),
    "a": (0, -2, 1),
    "load": (1, 0, 0),
    "gravity": (1, 0, 0),
}
_PRODUCT = " * "
_NAME = r"(?P<joint>[^\s|()^*]+)"
_VARIABLE = rf"(?P<quantity>{'|'.join(_DIMENSION)})_{_NAME}"
_NUMBER = r"(?P<number>\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
_ANGLE = rf"\((?:{_NUMBER} )?(?P<quantity>q)_{_NAME}\)"
# How a shape is written, and its function of a quantity and a number.
_SHAPES: dict[str, tuple[str, Callable[[FloatArray, float], FloatArray]]] = {
    "power": (rf"{_VARIABLE}(?:\^(?P<number>[2-5]))?", lambda x, k: x ** int(k)),
    "size": (rf"\|{_VARIABLE}\|", lambda x, _: np.abs(x)),
    "sign": (rf"sign\((?P<quantity>v)_{_NAME}\)", lambda x, _: x / np.hypot(x, SOFT_SPEED)),
    "sin": (f"sin{_ANGLE}", lambda x, k: np.sin(k * x)),
    "cos": (f"cos{_ANGLE}", lambda x, k: np.cos(k * x)),
}

_HELP = (
    "a term is '1' or a product such as 'sin(2 q_hip) * sign(v_knee)' of the factors q_JOINT, "
    "v_JOINT, a_JOINT, load_JOINT, gravity_JOINT, their powers ^2 to ^5 and sizes |...|, "
    "sign(v_JOINT), sin(K q_JOINT), cos(K q_JOINT)"
)


@dataclass(frozen=True)
class Factor:
    """One function of one quantity of one joint.

    Attributes:
        shape: `power`, `size` (absolute value), `sign`, `sin` or `cos`.
        quantity: `q` position [rad, m], `v` velocity, `a` acceleration, `load` the torque that the
            links ask of the joint [N m, N], `gravity` its part from gravity alone.
        joint: the joint's name.
        number: the power, or the order k of sin(k q); 1 otherwise.
        text: as it was written.
    """

    shape: str
    quantity: str
    joint: str
    number: float
    text: str = field(compare=False)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the factor that `text` writes.

        Raises:
            EffectError: the text is no factor; the message holds the grammar.
        """
        for shape, (pattern, _) in _SHAPES.items():
            match = re.fullmatch(pattern, text)
            if match is not None:
                found = match.groupdict()
                number = float(found.get("number") or 1.0)
                return cls(shape, found["quantity"], found["joint"], number, text)
        raise EffectError(f"'{text}' is no factor of a torque term: {_HELP}.")

    def value(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the factor (...) along a motion; a sign is softened."""
        quantity = _quantity(robot, motion, self.quantity, self.joint)
        return np.asarray(_SHAPES[self.shape][1](quantity, self.number))


@dataclass(frozen=True)
class TorqueTerm:
    """A coefficient times a product of factors; no factor at all is a constant.

    Attributes:
        coefficient: in the unit that makes the product a torque.
        factors: in the order written.
    """

    coefficient: float
    factors: tuple[Factor, ...]

    @classmethod
    def parse(cls, text: str, coefficient: float = 1.0) -> Self:
        """Return the term whose product `text` writes, for example `q_hip * sign(v_knee)`.

        Raises:
            EffectError: the text is no such product.
        """
        if text == "1":
            return cls(float(coefficient), ())
        return cls(float(coefficient), tuple(Factor.parse(part) for part in text.split(_PRODUCT)))

    @property
    def text(self) -> str:
        """The product without its coefficient, as `parse` reads it."""
        return _PRODUCT.join(factor.text for factor in self.factors) or "1"

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints whose motion it depends on."""
        return tuple(dict.fromkeys(factor.joint for factor in self.factors))

    @property
    def needs_acceleration(self) -> bool:
        """Whether it can only be evaluated where accelerations are known: along a log."""
        return any(factor.quantity in ("a", "load") for factor in self.factors)

    def unit(self, prismatic: Collection[str] = (), at_slide: bool = False) -> str:
        """Return the unit of the coefficient.

        Args:
            prismatic: names of the joints that slide; all others turn.
            at_slide: whether the term acts on a joint that slides (a force, not a torque).
        """
        power = {"N": 1, "m": 0 if at_slide else 1, "s": 0, "rad": 0}
        for factor in (f for f in self.factors if f.shape in ("power", "size")):
            slides = factor.joint in prismatic
            torque, time, length = (int(factor.number) * d for d in _DIMENSION[factor.quantity])
            power["N"] -= torque
            power["m"] -= length if slides else torque
            power["rad"] -= 0 if slides else length
            power["s"] -= time

        def written(sign: int) -> list[str]:
            some = {name: sign * n for name, n in power.items() if sign * n > 0}
            return [name if n == 1 else f"{name}^{n}" for name, n in some.items()]

        above, below = " ".join(written(1)) or "1", " ".join(written(-1))
        if " " in below:
            below = f"({below})"
        return f"{above}/{below}" if below else above

    def complexity(self, joint: str) -> float:
        """Return how much one is asked to believe who did not know this term before [nats].

        One of all kinds of factors, and more for each of them, for motion of other joints than the
        one on which it acts, for friction that turns round with a position or load, and most for
        what a controller cannot know.
        """
        powers = [factor for factor in self.factors if factor.shape == "power"]
        dry = any(factor.shape == "sign" for factor in self.factors)
        turning = dry and any(factor.number % 2 == 1 for factor in powers)
        return (
            float(np.log(len(_SHAPES) * len(_DIMENSION)))
            + len(self.factors)
            + 0.5 * sum(factor.number - 1.0 for factor in powers)
            + 0.1 * sum(factor.shape in ("sin", "cos", "size") for factor in self.factors)
            + 0.3 * turning
            + sum(other != joint for other in self.joints)
            + 3.0 * self.needs_acceleration
        )

    def direction_of(self, joint: str) -> Factor | None:
        """Return the factor sign(v) of that joint, None where it has none."""
        return next((f for f in self.factors if f.shape == "sign" and f.joint == joint), None)

    def check(self, where: str) -> None:
        """Raise EffectError for a product that makes no sense as a torque on joint `where`."""
        signs = [f.joint for f in self.factors if f.shape == "sign"]
        if len(set(signs)) < len(signs):
            raise EffectError(f"the term '{self.text}' at '{where}' holds a sign twice.")
        own = [f for f in self.factors if f.quantity == "v" and f.joint == where]
        odd = any(f.shape == "power" and f.number % 2 == 1 for f in own)
        if where in signs and odd:
            raise EffectError(
                f"the term '{self.text}' at '{where}' is no dry friction: write "
                f"v_{where} * sign(v_{where}) as |v_{where}|."
            )

    def value(self, robot: Robot, motion: Motion, without: Factor | None = None) -> FloatArray:
        """Return the product (...) along a motion, times no coefficient."""
        result = np.ones(motion.velocity.shape[:-1])
        for factor in self.factors:
            if factor is not without:
                result = result * factor.value(robot, motion)
        return result


def _quantity(robot: Robot, motion: Motion, quantity: str, joint: str) -> FloatArray:
    require_known(EffectError, "joint in a torque term", joint, robot.single_joints)
    row = robot.velocity_index(joint)
    if quantity == "q":
        return np.asarray(motion.position[..., robot.position_index(joint)])
    if quantity == "v":
        return np.asarray(motion.velocity[..., row])
    if quantity == "gravity":
        rest = np.zeros(motion.velocity.shape)
        return _asked(robot, motion.position, rest, rest)[..., row]
    if motion.acceleration is None:
        raise EffectError(
            f"a torque term holds {quantity}_{joint}, which needs accelerations: it can be "
            "compared with logs, but a controller or a simulator does not know it in advance."
        )
    asked = motion.acceleration
    if quantity == "load":
        asked = _asked(robot, motion.position, motion.velocity, motion.acceleration)
    return np.asarray(asked[..., row])


def _asked(
    robot: Robot, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return the torque (..., nv) that the links without contacts ask of the coordinates."""
    data = robot.model.createData()
    result = np.empty(velocity.shape)
    for k in np.ndindex(result.shape[:-1]):
        result[k] = pin.rnea(robot.model, data, position[k], velocity[k], acceleration[k])
    return result


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

    parameters = ()
    explanation = "A formula that fits the logs: regression found it; it has no cause of its own."
    experiment = (
        "Move only the joints in the formula, one at a time, over a wider range of position and "
        "speed than before, and see whether the formula still holds."
    )
    # No screens: formulas are searched for on their own, not beside named causes.
    search = SearchOffer(
        screens=lambda *_: (),
        freedom=lambda effect: sum(1.0 + term.complexity(effect.where) for term in effect.terms),
    )

    def __post_init__(self) -> None:
        """Check the terms and give every coefficient its name."""
        object.__setattr__(self, "terms", tuple(self.terms))
        if not self.terms:
            raise EffectError(f"{self.name} at '{self.where}' needs at least one term.")
        if len({term.factors for term in self.terms}) < len(self.terms):
            raise EffectError(f"{self.name} at '{self.where}' holds a term twice.")
        for term in self.terms:
            term.check(self.where)
            object.__setattr__(self, term.text, term.coefficient)
        parameters = tuple(
            Parameter(t.text, t.unit(), 0.0, -_LARGEST, _LARGEST, abs(t.coefficient) or 1.0)
            for t in self.terms
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

    @property
    def needs_acceleration(self) -> bool:
        """Whether it can only be compared with logs, not controlled or simulated."""
        return any(term.needs_acceleration for term in self.terms)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless every joint of the formula is a joint of `robot`."""
        super().check_place(robot)
        for term in self.terms:
            for joint in term.joints:
                kind = f"joint in '{term.text}' at '{self.where}'"
                require_known(EffectError, kind, joint, robot.single_joints)
            if robot.floating_size and any(f.quantity == "load" for f in term.factors):
                raise EffectError(
                    f"the term '{term.text}' at '{self.where}' needs the load of a joint, which "
                    f"depends on contact forces on '{robot.name}'; gravity_JOINT does not."
                )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the smooth part of the formula at the joint, (..., nv) [N m]."""
        smooth = self._sum(robot, motion, signed=False)
        return None if smooth is None else self.on_joint(robot, motion, smooth)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the level of the terms with the joint's own sign(v), (..., nv) [N m], >= 0."""
        level = self._sum(robot, motion, signed=True)
        return None if level is None else self.on_joint(robot, motion, np.maximum(-level, 0.0))

    def _sum(self, robot: Robot, motion: Motion, signed: bool) -> FloatArray | None:
        """Return the sum (...) of the terms with or without the joint's own sign(v), less that."""
        own = [(term, term.direction_of(self.where)) for term in self.terms]
        parts = [
            getattr(self, term.text) * term.value(robot, motion, without=sign)
            for term, sign in own
            if (sign is not None) == signed
        ]
        return np.sum(parts, axis=0) if parts else None
