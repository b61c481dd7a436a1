"""What gears lose under load, and gears behind which a link moves on its own."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self, final, get_args

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import GearNumbers, JointEffect, offer_near_rest
from wbc.robot import Evidence, Motion, Robot, Screen, SearchOffer, Usual, number
from wbc.transmission import Flanks, wedge_backward_efficiency

# Gears lose from one per cent to half of the power, and some are self-locking, hardly beyond.
_FORWARD, _BACKWARD = Usual(1.0, 1.0, 0.5, factor=True), Usual(1.0, 1.0, 0.7)
# Load friction c is the efficiency 1 - c. At joints that carry next to no load it is told from no
# other friction, and all of them grow together without end.
_LOAD = Usual(0.0, 0.0, _FORWARD.spread)
_WEDGE = 0.02  # efficiencies this close to the wedge's relation are taken for it


def _efficiency_screens(
    kind: type[TransmissionEfficiency], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return two screens: the wedge's pair of efficiencies, and both of them free.

    The torque a gear needs is linear in 1/eta_f and eta_b, so losses are the coefficients.
    """
    null = kind.null_values(robot, where)
    forward, backward = null["forward_efficiency"], null["backward_efficiency"]
    step = 1e-3

    def efficiencies(loss: float, backward_loss: float) -> dict[str, float]:
        inverse = 1.0 / forward + step * loss
        return {
            "forward_efficiency": min(1.0 / inverse, 1.0) if inverse > 0.0 else np.inf,
            "backward_efficiency": min(backward - step * backward_loss, 1.0),
        }

    pair = Screen((efficiencies(1.0, 1.0),), lambda c: efficiencies(float(c[0]), float(c[0])))
    units = efficiencies(1.0, 0.0), efficiencies(0.0, 1.0)
    free = Screen(units, lambda c: efficiencies(float(c[0]), float(c[1])))
    return pair, free


def _efficiency_freedom(effect: TransmissionEfficiency) -> int:
    """One where the wedge's relation between the two efficiencies holds, else two."""
    wedge = float(wedge_backward_efficiency(effect.forward_efficiency))
    return 1 if abs(effect.backward_efficiency - wedge) < _WEDGE else 2


@final
@dataclass(frozen=True)
class TransmissionEfficiency(GearNumbers):
    """The forward and backward efficiency of one gear; they replace the robot's values.

    Attributes:
        forward_efficiency: eta_f, power out / power in when the motor drives.
        backward_efficiency: eta_b when the joint drives; zero or less is self-locking. Above one
            the gear would yield more than it takes.
    """

    forward_efficiency: float = field(metadata=number("1", 1.0, 0.05, 1.0, 0.1, usual=_FORWARD))
    backward_efficiency: float = field(metadata=number("1", 1.0, -20.0, 1.0, 0.1, usual=_BACKWARD))

    explanation = (
        "Sliding teeth lose a share of the power they carry; driving the joint from the motor "
        "and being driven back by the load lose different shares."
    )
    experiment = (
        "Lift and lower several known weights slowly: the lifting torque grows and the "
        "lowering torque shrinks in proportion to the weight."
    )
    search = SearchOffer(
        # No gear is without losses. In 184 generated logs (seeds 23, 31, 32) all 41 losses under
        # load that were stated are true, at a mean probability of 0.99 with nothing expected.
        expected=1.0,
        screens=_efficiency_screens,
        freedom=_efficiency_freedom,
    )

    def said(self, units: Mapping[str, str] | None = None) -> str:
        """Return what the gear loses either way."""
        forward = f"{100.0 * (1.0 - self.forward_efficiency):.2g} % when the motor drives"
        share = f"{100.0 * (1.0 - self.backward_efficiency):.2g} %"
        backward = share if self.backward_efficiency > 0.0 else "all of it, it locks,"
        return f"losses in the gear at {self.where} ({forward}, {backward} when the joint drives)"


@final
@dataclass(frozen=True)
class LoadFriction(JointEffect):
    """A friction torque coefficient * |T| sgn(v) that the transmitted torque itself causes.

    With t the mesh input: T v > 0 gives T = (1 - c) t, T v < 0 gives T = (1 + c) t, that is
    eta_f (1 - c) and eta_b / (1 + c): the pair that the paper prints for the wedge.

    Attributes:
        coefficient: c, between 0 and 1.
    """

    coefficient: float = field(metadata=number("1", 0.0, 0.0, 0.95, 0.1, usual=_LOAD))

    explanation = (
        "Bearings and teeth pressed by the load rub in proportion to it: the loss grows with "
        "the torque carried, equally in both directions."
    )
    experiment = (
        "Lift and lower several known weights slowly: the difference between lifting and "
        "lowering torque grows with the weight."
    )
    search = SearchOffer(
        expected=TransmissionEfficiency.search.expected,
        inseparable={
            "transmission_efficiency": (
                "Load friction c predicts the same as the efficiencies 1 - c (forward) and "
                "1 / (1 + c) (backward): if the fitted ones are these two, no run tells them "
                "apart, and you can use either."
            )
        },
    )

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose gear loses the share of the load as well."""
        own = TransmissionEfficiency.null_values(robot, self.where)
        own["forward_efficiency"] *= 1.0 - self.coefficient
        own["backward_efficiency"] /= 1.0 + self.coefficient
        return robot.with_transmission(robot.transmission.with_values(self.where, own))


@final
@dataclass(frozen=True)
class LoadStribeckFriction(GearNumbers):
    """Load friction near rest: its coefficient is c(w) = coefficient * exp(-(w/speed)^2).

    w is the speed of the gear's output. With t the mesh input: T w > 0 gives T = (1 - c(w)) t and
    T w < 0 gives T = (1 + c(w)) t, beside what the gear loses at any speed. So the gear has the
    efficiencies eta_f (1 - c(w)) and eta_b / (1 + c(w)). `LoadFriction` and this together are the
    Stribeck friction under load of BAM's models M4 to M6 (Duclusaud, Passault, Padois and Ly).

    Attributes:
        coefficient: c at rest, between 0 and 1; replaces the robot's value.
        speed: Stribeck speed [rad/s] at the gear's output; likewise.
    """

    coefficient: float = field(metadata=number("1", 0.0, 0.0, 0.95, 0.1))
    speed: float = field(metadata=number("rad/s", 0.1, 0.001, 20.0, 0.1, shape=True))

    numbers = (("coefficient", "slow_loss", 0), ("speed", "slow_speed", 0))
    explanation = (
        "Loaded teeth and bearings rub more while the film of grease between them is broken: the "
        "loss grows with the torque carried and falls as the joint picks up speed."
    )
    experiment = (
        "Lift and lower several known weights, very slowly and fast: the difference between "
        "lifting and lowering torque grows with the weight and is larger at low speed."
    )
    search = offer_near_rest(
        "coefficient",  # in which the torque is nearly linear
        (0.1, 0.25, 0.6),
        claims=2,  # friction that grows with the load, and that it falls with speed
        inseparable={
            "stribeck_friction": (
                "Where the gear carries one and the same load, friction near rest that grows with "
                "the load is friction near rest: runs with other loads tell them apart."
            )
        },
    )

    def joint_velocity(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return w (...) [rad/s] of the gear's output."""
        return np.asarray(motion.velocity @ robot.motor_rows[self.gear(robot)])


Side = Literal["link", "motor", "either"]
SIDES: tuple[Side, ...] = get_args(Side)


@dataclass(frozen=True)
class YieldingGear(GearNumbers, ABC):
    """Base of the effects that let a link stray from its motor, by the law of `Flanks`.

    A simulator carries the deflection as state; along a log the link is simulated behind the gear
    that the robot then has (`change`).

    Attributes:
        friction_side: on which side the friction of this joint rubs along a log: at the link's
            speed, which loads the gear, or at the motor's, which does not. `either` is the link's
            side until a fit has chosen. A simulator has it at the link.
        has_play: whether the link is free between the flanks.
    """

    friction_side: Side = field(default="either", kw_only=True)

    has_play: ClassVar[bool] = False
    # None: which flanks are worth trying only simulated links tell.
    search = SearchOffer(screens=lambda *_: (), gradual=False)

    @classmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the gear of a joint with these flanks; a spring has no play."""
        known = {**vars(flanks), "width": flanks.play}
        return cls.at(where, {p.name: known[p.name] for p in cls.parameters})

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the numbers of a gear that is all but rigid."""
        return {parameter.name: parameter.null for parameter in cls.parameters}

    def with_friction_at(self, side: Side) -> Self:
        """Return the same gear with the joint's friction on that side."""
        return self if side == self.friction_side else replace(self, friction_side=side)


_CREEPS = 0.5  # [s], damping over stiffness


@final
@dataclass(frozen=True)
class JointCompliance(YieldingGear):
    """A spring and a damper between motor and link.

    Positions are those of the motor; the link lags by load / stiffness and may swing.

    Attributes:
        stiffness: [N m/rad] at the joint.
        damping: [N m s/rad].
    """

    stiffness: float = field(metadata=number("N m/rad", 1e9, 1.0, 1e9, 100.0))
    damping: float = field(metadata=number("N m s/rad", 1.0, 0.0, 1e5, 1.0, shape=True))

    explanation = (
        "Shafts, belts and flex splines wind up: the link lags behind its motor in proportion "
        "to the load and swings after fast moves."
    )
    experiment = (
        "Stop abruptly from fast motion, and hang weights on the link at rest: it rings at one "
        "frequency, and sags while the motor does not."
    )

    # A gear that gives and comes back: one that creeps writes down any slow drift.
    search = replace(
        YieldingGear.search, recognisable=lambda own, *_: own.damping < _CREEPS * own.stiffness
    )


_LEAST_PLAY = 1e-4  # [rad]


@final
@dataclass(frozen=True)
class Backlash(YieldingGear):
    """The link is free to move within `width` of its motor and bounces on stiff flanks.

    Positions are those of the motor: the link's own are hidden, and its inertia leaves and
    strikes the gear at every reversal of the load.

    Attributes:
        width: whole play [rad] at the joint.
        stiffness: of the flanks [N m/rad].
        damping: of the flanks [N m s/rad].
    """

    width: float = field(metadata=number("rad", 0.0, 0.0, 0.5, 0.01, doubt=0.02))
    stiffness: float = field(
        metadata=number("N m/rad", 3000.0, 1.0, 1e7, 1000.0, shape=True, doubt=1.0)
    )
    damping: float = field(metadata=number("N m s/rad", 10.0, 0.0, 1e5, 5.0, shape=True, doubt=1.0))

    numbers = (("width", "backlash", 0),)
    # What a link does after a strike depends on more than the log shows: on 15 generated logs
    # widths were off by up to 4 %, flanks by factors.
    explanation = (
        "Teeth have clearance: whenever the load changes sign the link travels freely through "
        "it and strikes the other flank."
    )
    experiment = (
        "Hold the motor still and push the link both ways, or swing the load through zero "
        "slowly and fast: the link jumps while the motor does not."
    )

    has_play: ClassVar[bool] = True
    # Flanks without play are a spring.
    search = replace(YieldingGear.search, recognisable=lambda own, *_: own.width > _LEAST_PLAY)
