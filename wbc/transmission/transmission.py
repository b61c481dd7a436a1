"""The transmission of a robot: reduction, topology, rotors and their efficiencies."""
# ruff: noqa: RUF009 - the calls at the fields of a transmission make fields

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.arrays import FloatArray, Remade, checked, frozen
from wbc.errors import TransmissionError, require_known
from wbc.transmission.mesh import Flanks, wedge_backward_efficiency

DRIVE_TIMES = ("target_delay", "feedback_delay", "velocity_lag")
"""Fields that say how late a drive follows its target and sees its own motion."""

_Rule = tuple[Callable[[FloatArray], NDArray[np.bool_]], str]


class GearNumber(NamedTuple):
    """What is known of a number that every gear has.

    Attributes:
        unit: SI unit, "1" for a pure number.
        default: where it is left out; NaN where it may be unknown, None where there is none.
        rules: what must hold of it, and that in words.
    """

    unit: str
    default: float | None
    rules: tuple[_Rule, ...]

    def require(self, values: FloatArray, name: Callable[..., str]) -> None:
        """Raise TransmissionError where a rule does not hold of a value; `name` calls it so."""
        for holds, rule in self.rules:
            for k in np.flatnonzero(~holds(values)):
                place = np.unravel_index(k, values.shape)
                raise TransmissionError(f"{name(*place)} is {values[place]:g}; it must be {rule}.")


def _number(unit: str, default: float | None, *rules: _Rule, needed: bool = False) -> Any:
    """Return the field of a number of a gear, which may be left out unless it is needed."""
    told = {"number": GearNumber(unit, default, rules)}
    return field(metadata=told) if needed else field(default=None, metadata=told)


_POSITIVE: _Rule = (lambda x: x > 0.0, "> 0")
_AT_LEAST_0: _Rule = (lambda x: x >= 0.0, ">= 0")
_POSITIVE_IF_KNOWN: _Rule = (lambda x: ~(x <= 0.0), "> 0, or NaN where unknown")
_AT_LEAST_0_IF_KNOWN: _Rule = (lambda x: ~(x < 0.0), ">= 0, or NaN where unknown")
_AT_MOST_1: _Rule = (lambda x: x <= 1.0, "<= 1")
_NO_POWER: _Rule = (
    _AT_MOST_1[0],
    "at most 1 (above it a gear that its joint drives would create power)",
)
_SHARE: _Rule = (lambda x: (x >= 0.0) & (x < 1.0), ">= 0 and < 1")
_NOT_0: _Rule = (lambda x: x != 0.0, "other than 0")


@dataclass(frozen=True, eq=False)
class Transmission(Remade):
    """What stands between m rotors and m joints (Sim & Ramos, section III).

    dpsi = R dphi with R = diag(1/N), dq_m = D dpsi, and by duality a joint torque B tau_phi with
    the distribution B = (D R)^-T.

    Attributes:
        joints: names of the m driven joints, in the order of every array below.
        gear_ratio: N (m,), rotor turns per turn of the motor's output; a sign reverses the sense.
        topology: D (m, m), identity for serial drives.
        rotor_inertia: I_r (m,) [kg m^2], before the reduction.
        forward_efficiency: eta_f (m,), in (0, 1].
        backward_efficiency: eta_b (m,), at most 1; zero or less is self-locking. When left out it
            follows from the wedge: 2 - 1/eta_f.
        rotor_coulomb_friction: (m,) [N m] on the rotor, inside the mesh law.
        rotor_viscous_friction: (m,) [N m s/rad] on the rotor.
        torque_limit: (m,) [N m] on the rotor.
        speed_limit: (m,) [rad/s] of the rotor.
        torque_constant: (m,) [N m/A] of the motor, NaN where unknown.
        resistance: (m,) [ohm] of the winding, NaN where unknown.
        position_gain: kp (m,) [N m/rad] of a drive that follows target positions, at the motor
            output; NaN where there is none.
        velocity_gain: kd (m,) [N m s/rad] of that drive.
        duty_gain: (m,) [1/rad] duty per position error at the motor output of a drive that sets
            the voltage on the winding instead; NaN where there is none.
        supply_voltage: (m,) [V] of that drive, NaN where unknown.
        target_delay: (m,) [s] by which that drive follows its target later than a log says: its
            bus, and half the time for which it holds a target; NaN where unknown.
        feedback_delay: (m,) [s] by which that drive sees its own motion later than a log says; NaN
            where unknown.
        velocity_lag: (m,) [s] time constant of the filter of that drive's velocity; NaN where
            unknown.
        stiffness: (m,) [N m/rad] between gear and joint, at the motor output; infinite is rigid.
        damping: (m,) [N m s/rad] beside the stiffness.
        backlash: (m,) [rad], the whole free play at the motor output.
        slow_loss: (m,) share c of the load that a gear loses beside its efficiencies at rest:
            eta_f (1 - c(w)) and eta_b / (1 + c(w)) with c(w) = c exp(-(w/slow_speed)^2).
        slow_speed: (m,) [rad/s] at the motor output.
        housings: name of the link that carries each motor, "" or nothing at all for the link
            before the joint; a parallelogram's second motor sits on the base, not on the thigh.
    """

    joints: tuple[str, ...]
    gear_ratio: FloatArray = _number("1", None, _NOT_0, needed=True)
    rotor_inertia: FloatArray = _number("kg m^2", None, _AT_LEAST_0, needed=True)
    topology: FloatArray = None  # type: ignore[assignment]
    forward_efficiency: FloatArray = _number("1", 1.0, _POSITIVE, _AT_MOST_1)
    backward_efficiency: FloatArray = _number("1", None, _NO_POWER)
    rotor_coulomb_friction: FloatArray = _number("N m", 0.0, _AT_LEAST_0)
    rotor_viscous_friction: FloatArray = _number("N m s/rad", 0.0, _AT_LEAST_0)
    torque_limit: FloatArray = _number("N m", np.inf, _POSITIVE)
    speed_limit: FloatArray = _number("rad/s", np.inf, _POSITIVE)
    torque_constant: FloatArray = _number("N m/A", np.nan, _POSITIVE_IF_KNOWN)
    resistance: FloatArray = _number("ohm", np.nan, _POSITIVE_IF_KNOWN)
    position_gain: FloatArray = _number("N m/rad", np.nan, _POSITIVE_IF_KNOWN)
    velocity_gain: FloatArray = _number("N m s/rad", 0.0, _AT_LEAST_0)
    duty_gain: FloatArray = _number("1/rad", np.nan, _POSITIVE_IF_KNOWN)
    supply_voltage: FloatArray = _number("V", np.nan, _POSITIVE_IF_KNOWN)
    target_delay: FloatArray = _number("s", np.nan, _AT_LEAST_0_IF_KNOWN)
    feedback_delay: FloatArray = _number("s", np.nan, _AT_LEAST_0_IF_KNOWN)
    velocity_lag: FloatArray = _number("s", np.nan, _AT_LEAST_0_IF_KNOWN)
    stiffness: FloatArray = _number("N m/rad", np.inf, _POSITIVE)
    damping: FloatArray = _number("N m s/rad", 0.0, _AT_LEAST_0)
    backlash: FloatArray = _number("rad", 0.0, _AT_LEAST_0)
    slow_loss: FloatArray = _number("1", 0.0, _SHARE)
    slow_speed: FloatArray = _number("rad/s", 1.0, _POSITIVE)
    housings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Fill defaults, check every array and freeze it."""
        joints = tuple(self.joints)
        object.__setattr__(self, "joints", joints)
        if len(set(joints)) != len(joints):
            raise TransmissionError(f"a joint is driven twice: {', '.join(joints)}.")
        m = len(joints)
        object.__setattr__(self, "housings", tuple(self.housings))
        if len(self.housings) not in (0, m):
            raise TransmissionError(f"{len(self.housings)} housings for {m} motors.")
        for name, number in GEAR_NUMBERS.items():
            given = getattr(self, name)
            if given is None and number.default is None:  # `forward_efficiency` is known by now
                given = wedge_backward_efficiency(self.forward_efficiency)
            self._store(name, np.full(m, number.default) if given is None else given)
        topology = np.eye(m) if self.topology is None else self.topology
        topology = checked(topology, (m, m), "topology D", TransmissionError)
        object.__setattr__(self, "topology", topology)
        if m and np.linalg.cond(self.topology) > 1e8:
            raise TransmissionError("topology D is singular: some motor motion moves no joint.")

    def _store(self, name: str, values: ArrayLike) -> None:
        """Freeze and check the numbers of a field that has one per gear."""
        label, m = f"transmission {name}", len(self.joints)
        array, number = np.asarray(values, dtype=np.float64), GEAR_NUMBERS[name]
        if number.default is None or np.isfinite(number.default):
            array = checked(array, (m,), label, TransmissionError)
        elif array.shape != (m,):
            raise TransmissionError(f"{label} has shape {array.shape}, expected ({m},).")
        object.__setattr__(self, name, frozen(array))
        number.require(array, lambda k: f"{name} of joint '{self.joints[k]}'")

    @property
    def size(self) -> int:
        """m, the number of gears."""
        return len(self.joints)

    # The derived matrices are asked for in every tick: computed once, kept read-only.

    @cached_property
    def copper_loss(self) -> FloatArray:
        """R / k_t^2 (m,), Joule heat per squared rotor torque [W/(N m)^2]; NaN where unknown."""
        return frozen(self.resistance / self.torque_constant**2)

    @cached_property
    def reduction(self) -> FloatArray:
        """R = diag(1/N), (m, m): dpsi = R dphi."""
        return frozen(np.diag(1.0 / self.gear_ratio))

    @cached_property
    def distribution(self) -> FloatArray:
        """B = (D R)^-T, (m, m): joint torque = B E_m tau_phi in quasi-statics."""
        return frozen(np.linalg.solve(self.topology.T, np.diag(self.gear_ratio)))

    @cached_property
    def motor_from_joint(self) -> FloatArray:
        """D^-1, (m, m): dpsi = D^-1 dq_m."""
        return frozen(np.linalg.inv(self.topology))

    def joints_from_rotors(self, rotors: FloatArray) -> FloatArray:
        """Return joint angles or rates (..., m) from those of the rotors: q_m = D phi / N."""
        return np.asarray((rotors / self.gear_ratio) @ self.topology.T)

    @cached_property
    def reflected_inertia(self) -> FloatArray:
        """N^2 I_r (m,) [kg m^2], the rotor's inertia felt at the motor output."""
        return frozen(self.gear_ratio**2 * self.rotor_inertia)

    @cached_property
    def self_locking(self) -> NDArray[np.bool_]:
        """Whether each gear holds any joint torque without the motor (eta_b <= 0), (m,) bool."""
        return frozen(self.backward_efficiency <= 0.0, np.bool_)

    def index(self, joint: str) -> int:
        """Return the row of `joint`.

        Raises:
            TransmissionError: no such driven joint; the message lists those there are.
        """
        require_known(TransmissionError, "driven joint", joint, self.joints)
        return self.joints.index(joint)

    def replace(self, **changes: Any) -> Transmission:
        """Return a copy with some fields changed; what is changed is checked.

        A search for causes asks for a hundred thousand copies that differ in one number.
        """
        if not changes.keys() <= GEAR_NUMBERS.keys() or any(v is None for v in changes.values()):
            return replace(self, **changes)
        copy = self._with()
        for name, values in changes.items():
            copy._store(name, values)
        return copy

    def with_values(self, joint: str, numbers: Mapping[str, float]) -> Transmission:
        """Return a copy in which some numbers of one gear are changed, by their fields' names.

        Raises:
            TransmissionError: no such driven joint, or a number outside its range.
        """
        own = np.arange(self.size) == self.index(joint)
        pairs = numbers.items()
        return self.replace(**{n: np.where(own, value, getattr(self, n)) for n, value in pairs})

    def flanks(self, joint: str) -> Flanks:
        """Return the law of one gear that winds up or has play."""
        k, numbers = self.index(joint), (self.stiffness, self.damping, self.backlash)
        return Flanks(*(float(number[k]) for number in numbers))

    def lossless(self) -> Transmission:
        """Return the same gears with eta_f = eta_b = 1 at any speed and frictionless rotors."""
        kept = dict.fromkeys(("forward_efficiency", "backward_efficiency"), np.ones(self.size))
        lost = ("rotor_coulomb_friction", "rotor_viscous_friction", "slow_loss")
        return self.replace(**kept, **dict.fromkeys(lost, np.zeros(self.size)))


GEAR_NUMBERS: Mapping[str, GearNumber] = {
    one.name: one.metadata["number"] for one in fields(Transmission) if one.metadata
}
"""The fields of a transmission with one number per gear."""
