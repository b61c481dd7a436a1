"""Friction in proportion to the load that falls as the gear picks up speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer

_SLOWNESS = (0.1, 0.25, 0.6)  # of the usual speed; a fit goes on between them
_MOST = 0.95


def extra_share(w: FloatArray, coefficient: float, speed: float) -> FloatArray:
    """Return c(w) = coefficient * exp(-(w/speed)^2) (...) at speeds w of the output [rad/s]."""
    return coefficient * np.exp(-((w / speed) ** 2))


def _screens(
    kind: type[LoadStribeckFriction], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per Stribeck speed; the torque is nearly linear in the coefficient."""
    gear = robot.transmission.index(where)
    speeds = [_output_speed(robot, gear, motion) for motion in evidence.motions]
    usual = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    if usual == 0.0:
        return ()
    step = 1e-3

    def screen(speed: float) -> Screen:
        unit = {"coefficient": step, "speed": speed}
        return Screen((unit,), lambda c: {"coefficient": step * float(c[0]), "speed": speed})

    return tuple(screen(float(np.clip(s * usual, 0.001, 20.0))) for s in _SLOWNESS)


def _recognisable(effect: LoadStribeckFriction, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the gear passed twice the Stribeck speed: below it this is load friction."""
    gear = effect.gear(robot)
    fastest = max(np.abs(_output_speed(robot, gear, m)).max() for m in motions)
    return bool(2.0 * effect.speed < fastest)


@final
@dataclass(frozen=True)
class LoadStribeckFriction(JointEffect):
    """Load friction near rest: its coefficient is c(w) = coefficient * exp(-(w/speed)^2).

    w is the speed of the gear's output. With t the mesh input: T w > 0 gives T = (1 - c(w)) t and
    T w < 0 gives T = (1 + c(w)) t, beside what the gear loses at any speed. So the gear has the
    efficiencies eta_f (1 - c(w)) and eta_b / (1 + c(w)). `LoadFriction` and this together are the
    Stribeck friction under load of BAM's models M4 to M6 (Duclusaud, Passault, Padois and Ly).

    Attributes:
        coefficient: c at rest, between 0 and 1.
        speed: Stribeck speed [rad/s] at the gear's output.
    """

    coefficient: float
    speed: float

    name = "load_stribeck_friction"
    parameters = (
        Parameter("coefficient", "1", 0.0, 0.0, _MOST, 0.1),
        Parameter("speed", "rad/s", 0.1, 0.001, 20.0, 0.1, shape=True),
    )
    explanation = (
        "Loaded teeth and bearings rub more while the film of grease between them is broken: the "
        "loss grows with the torque carried and falls as the joint picks up speed."
    )
    experiment = (
        "Lift and lower several known weights, very slowly and fast: the difference between "
        "lifting and lowering torque grows with the weight and is larger at low speed."
    )
    search = SearchOffer(
        claims=2,  # friction that grows with the load, and that it falls with speed
        near_rest=True,
        inseparable={
            "stribeck_friction": (
                "Where the gear carries one and the same load, friction near rest that grows with "
                "the load is friction near rest: runs with other loads tell them apart."
            )
        },
        screens=_screens,
        recognisable=_recognisable,
    )

    def gear_efficiencies(
        self, robot: Robot, motion: Motion, forward: FloatArray, backward: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return eta_f and eta_b (..., m) with this gear's at the present speed."""
        gear = self.gear(robot)
        share = extra_share(_output_speed(robot, gear, motion), self.coefficient, self.speed)
        shape = (*motion.velocity.shape[:-1], robot.transmission.size)
        forward, backward = (np.array(np.broadcast_to(eta, shape)) for eta in (forward, backward))
        forward[..., gear] *= 1.0 - share
        backward[..., gear] /= 1.0 + share
        return forward, backward


def _output_speed(robot: Robot, gear: int | IntArray, motion: Motion) -> FloatArray:
    """Return w (...) [rad/s] of the output of a gear, (..., k) of k gears."""
    rows = robot.transmission.motor_from_joint[gear]
    return np.asarray(motion.velocity[..., robot.actuated] @ rows.T)
