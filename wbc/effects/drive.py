"""What a drive does with the torque it was asked for; its supply and warmth, and its rotor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import GearNumbers, JointEffect, ScaledDrive, range_of
from wbc.robot import Effect, Evidence, Motion, Robot, Screen, SearchOffer, Usual, number
from wbc.robot.effect import usual_cost

# Drives are off by ten to thirty per cent; a factor of two and more is a wrong unit or column.
_USUAL = Usual(1.0, 1.0, 0.2, factor=True)


@final
@dataclass(frozen=True)
class TorqueConstant(ScaledDrive):
    """The drive delivers factor times the torque that it reports.

    Attributes:
        factor: delivered / reported torque.
    """

    factor: float = field(metadata=number("1", 1.0, 0.2, 5.0, 0.1, usual=_USUAL))

    explanation = (
        "The torque constant in the drive is wrong, or the motor saturates: every torque is "
        "off by the same factor, in both directions of power."
    )
    experiment = (
        "Hang a known weight on the joint and hold it still from above and from below: the "
        "mean torque is off by the factor."
    )

    def factor_at(self, robot: Robot, motion: Motion) -> float:
        """Return the factor."""
        return self.factor


@final
@dataclass(frozen=True)
class TorqueOffset(JointEffect):
    """The drive delivers its reported torque plus a constant.

    Attributes:
        offset: delivered minus reported, on the motor output side [N m]; where it is positive, the
            column reads too low.
    """

    offset: float = field(metadata=number("N m", 0.0, -10000.0, 10000.0, 0.2))

    explanation = (
        "A current or torque sensor has a zero error, or a constant load such as a tensioned cable "
        "is not in the model. A positive offset says that the column reads too low."
    )
    experiment = "Hold the joint unloaded, coming from both sides: the mean torque is not zero."

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return offset / N on the rotor, (..., m) [N m]."""
        ratio = robot.transmission.gear_ratio[self.gear(robot)]
        return self.on_rotor(robot, motion, self.offset / ratio)


@final
@dataclass(frozen=True)
class RotorInertia(GearNumbers):
    """The rotor's inertia, as it is felt behind the reduction.

    Attributes:
        reflected_inertia: N^2 I_r [kg m^2] at the motor output; replaces the robot's value.
    """

    reflected_inertia: float = field(metadata=number("kg m^2", 0.0, 0.0, 10000.0, 0.02))

    numbers = (("reflected_inertia", "rotor_inertia", 2),)
    explanation = "The rotor, amplified by the gear ratio squared, is heavier than the model says."
    experiment = (
        "Shake the joint fast with small strokes about a pose that carries no load: the extra "
        "torque follows the acceleration."
    )
    search = SearchOffer(expected=1.0)


def _screens(
    kind: type[CurrentLimit], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per limit that reported or needed torques suggest.

    Where a drive saturates most of the time, its report lies far above the limit, and what
    the motion needed lies just below it.

    None where a target and the law of its drive make the torque: the law holds the limit that
    the robot states, so that nothing was reported which a lower one could clip. What a clip
    explains there is what the law leaves out, such as how a target is held and how late it
    comes (on a Go2's targets ten limits of 0.7 to 2 N m, each "certain", of stated 24 and 45).

    None where the drive reports a current either: that is what flowed, within any limit. What
    a clip explains there is something else (the search for TIAGo's arm took four limits in the
    place of losses in its gears and of rotors, and did not end in 150 CPU seconds).
    """
    column, row = robot.transmission.index(where), robot.velocity_index(where)
    fed_back = [motion.feedback_torque for motion in evidence.motions]
    follows = any(own is not None and np.any(own[..., column]) for own in fed_back)
    by_law = follows and np.isfinite(robot.transmission.torque_limit[column])
    if by_law or (evidence.currents is not None and evidence.currents[column]):
        return ()
    ratio = float(robot.transmission.gear_ratio[column])
    reported = [torque[:, column] * ratio for torque in evidence.reported]
    missing = [torque[:, row] for torque in evidence.unexplained]
    needed = [r - np.sign(ratio) * m for r, m in zip(reported, missing, strict=True)]
    seen, used = (np.abs(np.concatenate(parts)) for parts in (reported, needed))
    limits = [
        *np.quantile(seen, (0.5, 0.7, 0.8, 0.87, 0.93, 0.97, 0.99, 0.997)),
        *np.quantile(used, (0.3, 0.5, 0.7, 0.85, 0.95)),
    ]
    tried = [limit for limit in np.unique(limits).tolist() if 1e-3 < limit < seen.max()]
    return tuple(Screen.fixed({"limit": limit}) for limit in tried)


@final
@dataclass(frozen=True)
class CurrentLimit(JointEffect):
    """The delivered torque is clipped although the log shows what was asked for.

    A torque that a log holds as a current is not clipped: a limit lies before the measurement.

    Attributes:
        limit: largest torque delivered, at the motor output [N m].
    """

    limit: float = field(metadata=number("N m", 1e6, 1e-3, 1e6, 1.0))

    explanation = "The drive or its motor saturates: beyond a torque it gives less than it reports."
    experiment = (
        "Ask for slowly growing torques against a fixed stop with a force sensor: beyond the "
        "limit the force no longer follows."
    )
    search = SearchOffer(screens=_screens, gradual=False)

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the clipped torque of this gear, (..., m)."""
        limit = np.full(robot.transmission.size, np.inf)
        column = self.gear(robot)
        limit[column] = self.limit / np.abs(robot.transmission.gear_ratio[column])
        return np.clip(torque, -limit, limit)


# Share of a sample by which a drive may read its torque earlier or later than its position. It was
# 0.25 ms, 0.07 and 0.12 of a sample, on three robots of another simulator whose torques are held
# for 1 ms. On one of them, a sound leg, the delays of both joints were certain without this.
_BETWEEN = 0.1


@final
@dataclass(frozen=True)
class ActuationDelay(JointEffect):
    """The drive delivers its reported torque `delay` later.

    Along a log the torque is that of `delay` earlier. A simulator carries the torque that is on
    its way: what it delivers over a step is the mean of the command over the same time `delay`
    earlier, and nothing before the first command. A lone sample without past passes unchanged,
    because a controller cannot undo a delay. Of a drive that follows a target, the target comes
    late: what the drive makes of its own measurement does not.

    Attributes:
        delay: [s].
    """

    delay: float = field(metadata=number("s", 0.0, 0.0, 0.2, 0.005))

    explanation = "Bus, filter and current loop take time: the motor follows an earlier torque."
    experiment = (
        "Shake the joint fast with a torque of two frequencies: the error grows with frequency "
        "and follows the rate of change of the torque."
    )
    search = SearchOffer(tolerated=lambda own, robot, step: (own.delay / (_BETWEEN * step)) ** 2)

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return the torque on its way, rows (since how long [s], torques [N m]): none."""
        return np.array([[np.max(self.delay), *np.zeros(np.size(self.delay))]])

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque on its way (p, 1 + k) after a step; what has arrived is forgotten."""
        if motion.memory is None:
            return self.first_memory(robot)
        sent = np.vstack((motion.memory.value, [0.0, *np.ravel(torque[self.gear(robot)])]))
        sent[:, 0] += motion.memory.step
        arrived = int((sent[1:, 0] >= np.max(self.delay)).sum())
        return sent[arrived:]

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` earlier for this gear, (..., m)."""
        if motion.memory is None:
            return self._shifted(robot, motion, torque, -1.0)
        # the mean of the command over a step, delayed; its last part begins now
        sent, step, delay = motion.memory.value, motion.memory.step, np.ravel(self.delay)
        result, gear = np.array(torque), self.gear(robot)
        starts = np.concatenate(([-np.inf], -sent[1:, 0], [0.0, step]))
        held = np.vstack((sent[:, 1:], np.ravel(torque[gear])))
        passed = np.clip(starts[:, None], -delay, step - delay)
        mean = np.sum(np.diff(passed, axis=0) * held, axis=0) / step
        result[gear] = mean.reshape(np.shape(self.delay))
        return result

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` later for this gear, (..., m)."""
        return self._shifted(robot, motion, torque, 1.0)

    def _shifted(self, robot: Robot, motion: Motion, torque: FloatArray, way: float) -> FloatArray:
        if motion.time is None or np.ndim(motion.time) != 1:
            return torque
        result = np.array(torque)
        own = np.zeros_like(torque) if motion.feedback_torque is None else motion.feedback_torque
        for column, delay in zip(np.ravel(self.gear(robot)), np.ravel(self.delay), strict=True):
            late = torque[:, column] - own[:, column]
            shifted = np.interp(motion.time + way * delay, motion.time, late)
            result[:, column] = shifted + own[:, column]
        return result


_SAG_LEAVES = 0.1  # share of the torque that is left, however much power is drawn


@final
@dataclass(frozen=True)
class SupplySag(Effect):
    """All drives deliver less while the motors together draw power: 1 - coefficient * P.

    P is the electrical power of all motors, as reported, where it is positive: torque times speed
    plus what warms the windings, resistance (torque / torque_constant)^2. A stalled motor draws
    the latter. Motors whose winding is not described count with torque times speed alone.

    Attributes:
        coefficient: share of the torque lost per watt [1/W].
    """

    coefficient: float = field(metadata=number("1/W", 0.0, 0.0, 1.0, 0.001))

    explanation = "Battery and cables have resistance: drives give less while motors draw power."
    experiment = (
        "Log the supply voltage while several joints accelerate at once: the torque error "
        "follows the total power, also on joints that do little themselves."
    )

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque left, (..., m)."""
        power = np.maximum(np.add(*self._powers(robot, motion, torque)), 0.0)
        return np.asarray(torque * np.maximum(1.0 - self.coefficient * power, _SAG_LEAVES))

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque reported for a delivered one, (..., m).

        The share f that is delivered solves f = 1 - coefficient (P_shaft / f + P_heat / f^2), P
        being the powers of the delivered torque. Newton's method from f = 1 meets the largest
        root, the one at which more drive still gives more torque.
        """
        shaft, heat = (self.coefficient * power for power in self._powers(robot, motion, torque))
        share = np.ones_like(shaft)
        for _ in range(12):
            # A share that no longer falls there was the last: more drive gives less.
            slope = np.minimum(shaft / share**2 + 2.0 * heat / share**3, 1.0) - 1.0
            miss = np.minimum(1.0 - shaft / share - heat / share**2, 1.0) - share
            step = np.divide(miss, slope, out=share.copy(), where=slope < 0.0)
            share = np.clip(share - step, _SAG_LEAVES, 1.0)
        return np.asarray(torque / share)

    @staticmethod
    def _powers(robot: Robot, motion: Motion, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the power of all motors at their shafts and in their windings, (..., 1) [W]."""
        gears = robot.transmission
        spin = motion.velocity[..., robot.actuated] @ gears.motor_from_joint.T * gears.gear_ratio
        ohmic = np.nan_to_num(gears.copper_loss)
        shaft = np.sum(torque * spin, axis=-1, keepdims=True)
        return shaft, np.sum(ohmic * torque**2, axis=-1, keepdims=True)


# A drive that sets the duty of a winding follows its supply fully, one that regulates the current
# not at all; poor regulation lies between.
_FOLLOWS = Usual(0.0, 1.0, 0.1)
_LEAST = 0.05  # share of the torque that is always left


def _voltage_screens(
    kind: type[VoltageScaling], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return the screens of nominal voltages; none where the voltage stayed or was not logged.

    The torque is linear in 1 - share and share / nominal, so two screens span them all: one
    at the middle of what was logged, and one at the robot's own voltage.
    """
    if not _voltage_recognisable(kind.at(where), robot, evidence.motions):
        return ()
    lowest, highest = range_of(robot, where, (m.supply_voltage for m in evidence.motions))
    described = robot.transmission.supply_voltage[robot.transmission.index(where)]
    nominals = dict.fromkeys([0.5 * (lowest + highest), highest, described])
    tried = np.clip([nominal for nominal in nominals if np.isfinite(nominal)], 1.0, 1000.0)
    return Screen.shapes("share", "nominal", tried, step=1e-2)


def _voltage_recognisable(effect: VoltageScaling, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the voltage changed: at one voltage this is a wrong torque constant."""
    lowest, highest = range_of(robot, effect.where, (m.supply_voltage for m in motions))
    return bool(0.0 < lowest < highest < np.inf)


@final
@dataclass(frozen=True)
class VoltageScaling(ScaledDrive):
    """The drive delivers 1 + share * (U / nominal - 1) times the torque that it reports.

    U is the supply's voltage, the column `<joint>.voltage` of a log. Where none was logged it is
    the robot's `supply_voltage`; where that is unknown, too, U is the nominal one.

    Attributes:
        share: how far the torque follows the supply: 1 fully, 0 not at all.
        nominal: supply [V] at which the drive delivers what it reports.
    """

    share: float = field(metadata=number("1", 0.0, 0.0, 2.0, 0.1, usual=_FOLLOWS))
    nominal: float = field(metadata=number("V", 24.0, 1.0, 1000.0, 1.0, shape=True))

    explanation = (
        "The drive turns torque into a share of the supply's voltage and takes that voltage for "
        "constant: on a battery that runs down it delivers less than it reports."
    )
    experiment = (
        "Repeat one motion at two supply voltages, such as a full and a nearly empty battery, and "
        "log the voltage: the torque is off by the ratio of the two."
    )
    search = SearchOffer(
        claims=2,  # a torque that is off, and that it follows the supply
        screens=_voltage_screens,
        recognisable=_voltage_recognisable,
    )

    def factor_at(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the share of the torque that is left, (...)."""
        gear = self.gear(robot)
        voltage = np.asarray(robot.transmission.supply_voltage[gear])
        if motion.supply_voltage is not None:
            voltage = motion.supply_voltage[..., gear]
        known = np.where(np.isfinite(voltage), voltage, self.nominal)
        return np.maximum(1.0 + self.share * (known / self.nominal - 1.0), _LEAST)


# Windings of motors from a finger's to an arm's size warm up in 2 to 60 s, their housings in
# minutes to an hour (makers' data sheets); a longer time is a steady drift.
_WARMS_UP_IN = Usual(5.0, 1e5, 0.4, factor=True)  # [s]
# Magnets lose 0.1 (rare earths) to 0.2 % (ferrite) of their torque per kelvin; windings of a motor
# that is fed a voltage lose 0.4 %. A motor that was warm and cools down gains some of it back.
_LOST = Usual(0.0, 0.2, 0.15)


def _drift_screens(
    kind: type[ThermalDrift], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per time constant, from a tenth of the log's length to ten times."""
    times = [motion.time for motion in evidence.motions if motion.time is not None]
    if not times:
        return ()
    length = max(float(time[-1] - time[0]) for time in times)
    tried = np.clip(np.multiply((0.1, 0.4, 2.0, 10.0), length), 1.0, 1e5)
    return Screen.shapes("rate", "time_constant", tried, step=1e-5)


def _drift_implausibility(effect: ThermalDrift, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what the time constant costs, and the torque lost at the end of the logs."""
    lost = max((effect.rate * float(np.max(effect._warm(m, 0.5))) for m in motions), key=_LOST.cost)
    return usual_cost(effect) + _LOST.cost(lost)


@final
@dataclass(frozen=True)
class ThermalDrift(ScaledDrive):
    """The delivered torque falls as the motor warms up: 1 - rate tau (1 - exp(-t/tau)).

    t counts from the start of the log; a simulator carries the warmth from step to step, so that a
    motor stays warm where a run is taken up again. A negative rate is a motor that grows
    stronger; a time constant much longer than the log is a steady drift.

    Attributes:
        rate: share of the torque lost per second at the start [1/s].
        time_constant: tau [s].
    """

    rate: float = field(metadata=number("1/s", 0.0, -0.5, 0.5, 0.005))
    time_constant: float = field(
        metadata=number("s", 60.0, 1.0, 1e5, 10.0, shape=True, usual=_WARMS_UP_IN)
    )

    explanation = "As magnets and windings warm up, the same motion asks for ever more torque."
    experiment = (
        "Repeat one loaded motion for several minutes and log the motor's temperature: the "
        "torque drifts with it and comes back after a pause."
    )
    search = SearchOffer(screens=_drift_screens, implausibility=_drift_implausibility)

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return how warm the motors are, as the drift's warm seconds (k,): cold."""
        return np.zeros(np.size(self.rate))

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the warm seconds (k,) at the end of a step."""
        return np.ravel(self._warm(motion, 1.0))

    def factor_at(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the share of the torque that is left, (...)."""
        return np.maximum(1.0 - self.rate * self._warm(motion, 0.5), _LEAST)

    def _warm(self, motion: Motion, share: float) -> FloatArray:
        """Return w, dw/dt = 1 - w/tau, from w = 0: along a log, or `share` of a step onward."""
        if motion.memory is not None:
            time = np.asarray(share * motion.memory.step)
            start = np.reshape(motion.memory.value, np.shape(self.rate))
        else:
            none = np.zeros(motion.velocity.shape[:-1])
            time = none if motion.time is None else np.asarray(motion.time)
            time, start = time.reshape((*time.shape, *(1,) * np.ndim(self.rate))), np.zeros(())
        gone = -np.expm1(-time / self.time_constant)
        return np.asarray(start + (self.time_constant - start) * gone)


_CHAIN: tuple[type[Effect], ...] = (ActuationDelay, CurrentLimit, SupplySag)


def in_drive_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects with those of the drives in the order in which a drive acts.

    It takes its command late, clips it, and what is left sags with its supply. What changes the
    torque by a factor comes after them. In which order causes were found is no evidence of it.
    """
    found = tuple(effects)

    def link(effect: Effect) -> int:
        return (*(isinstance(effect, kind) for kind in _CHAIN), True).index(True)

    drives = iter(sorted((e for e in found if "drive" in e.acts_by), key=link))
    return tuple(next(drives) if "drive" in effect.acts_by else effect for effect in found)
