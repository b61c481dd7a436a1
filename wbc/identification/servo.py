"""A position servo fitted by output error: models from few numbers to many, on whole runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares
from scipy.stats import sem

from wbc.arrays import FloatArray
from wbc.effects.friction import CoulombFriction, StribeckFriction, ViscousFriction
from wbc.effects.gear_losses import LoadFriction
from wbc.effects.links import GravityDirection
from wbc.errors import IdentificationError
from wbc.files import as_json
from wbc.identification.answer.shown import plain
from wbc.identification.readings.checks import require_robot_and_logs
from wbc.measurement import Log
from wbc.robot import Effect, Robot, state_gear
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout
from wbc.tables import TextTable
from wbc.transmission import GEAR_NUMBERS

MOTOR = ("torque_constant", "resistance", "rotor_inertia")
"""Fitted numbers that the description of a gear holds."""
_FRICTION = (*MOTOR, "tilt", "coulomb", "viscous")
_STRIBECK = (*_FRICTION, "load", "stribeck", "stribeck_speed")
MODELS: dict[str, tuple[str, ...]] = {
    "Coulomb and viscous friction": _FRICTION,
    "and load friction": (*_FRICTION, "load"),
    "and Stribeck friction": _STRIBECK,
    "and supply sag": (*_STRIBECK, "source_resistance"),
}
"""Name of a model -> its numbers; each holds those of the one before."""

UNITS = {name: GEAR_NUMBERS[name].unit for name in MOTOR} | {
    "tilt": "rad",
    "coulomb": "N m",
    "viscous": "N m s/rad",
    "load": "1",
    "stribeck": "N m",
    "stribeck_speed": "rad/s",
    "source_resistance": "ohm",
}
# Bounds of the motor's numbers, as a factor; fits of the recorded XL330 move them by 1.7 at most.
_SHEET = 3.0
_SOFT = 0.03  # [rad] error from which on it counts linearly: a missed stick is no worse twice
_EVERY = 4  # rows of a rollout between two residuals of the fit
_STEP = 1e-3  # [s]; with 5 ms the dry friction of a simulated servo comes out 12 % low, not 3 %
_FOLDS = 6
_ITERATIONS = 25  # of one fit, at most
_HOLD = 0.1  # [rad] of one residual that doubling a number costs which the runs leave open
_NUDGE = 1e-3  # of a number, in scales: small beside a fit's own uncertainty
_ENOUGH = 3e-5  # relative fall of the cost with which a fit ends


class Span(NamedTuple):
    """Bounds and start of one number."""

    low: float
    start: float
    high: float


Build = Callable[[Mapping[str, float]], tuple[Robot, DcDrive]]


def _build(robot: Robot, values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
    """Return robot and drive with these numbers; what is not given is not there.

    Args:
        robot: as it was given, with one driven joint and the numbers of its motor.
        values: by the names in `UNITS`.
    """
    gears = robot.transmission
    joint, ratio = gears.joints[0], float(gears.gear_ratio[0])
    changed = gears.replace(
        torque_constant=[values["torque_constant"]],
        resistance=[values["resistance"]],
        rotor_inertia=[values["rotor_inertia"] / ratio**2],
    )
    # Gravity tilts about the joint's axis.
    roll, pitch, _ = (values["tilt"] * robot.mounting.axis[0]).tolist()
    effects: list[Effect] = [
        GravityDirection("robot", roll, pitch),
        CoulombFriction(joint, values["coulomb"]),
        ViscousFriction(joint, values["viscous"]),
    ]
    if "load" in values:
        effects.append(LoadFriction(joint, values["load"]))
    if "stribeck" in values:
        effects.append(StribeckFriction(joint, values["stribeck"], values["stribeck_speed"]))
    drive = DcDrive(float(gears.supply_voltage[0]), values.get("source_resistance", 0.0))
    return robot.with_transmission(changed).with_effects(*effects), drive


def _require_motor(robot: Robot) -> None:
    gears = robot.transmission
    if robot.model.nv != 1 or gears.size != 1:
        raise IdentificationError(
            f"'{robot.name}' has {robot.model.nv} joints; a rollout of a servo is for one "
            "driven joint. Lock the others in robot.toml."
        )
    names = ("torque_constant", "resistance", "supply_voltage")
    if lacking := [name for name in names if not np.isfinite(getattr(gears, name)[0])]:
        raise IdentificationError(
            f"'{robot.name}': a rollout needs the motor's {', '.join(lacking)}; "
            + state_gear(gears.joints[0], *lacking)
        )


def _spans(robot: Robot) -> dict[str, Span]:
    """Return bounds and starts as shares of the motor's stall torque and idle speed.

    The shares are those of the recorded XL330 servo.
    """
    gears = robot.transmission
    ratio = abs(float(gears.gear_ratio[0]))
    constant, resistance = float(gears.torque_constant[0]), float(gears.resistance[0])
    stall = ratio * constant * float(gears.supply_voltage[0]) / resistance
    idle = float(gears.supply_voltage[0]) / (constant * ratio)
    rotor = float(gears.reflected_inertia[0])
    link = float(pin.crba(robot.model, robot.model.createData(), robot.neutral())[0, 0])
    return {
        "torque_constant": Span(constant / _SHEET, constant, _SHEET * constant),
        "resistance": Span(resistance / _SHEET, resistance, _SHEET * resistance),
        "rotor_inertia": Span(0.0, rotor or 0.1 * link, 10.0 * max(rotor, link)),
        "tilt": Span(-0.15, 0.0, 0.15),
        "coulomb": Span(0.0, 0.015 * stall, 0.3 * stall),
        "viscous": Span(0.0, 0.1 * stall / idle, 3.0 * stall / idle),
        "load": Span(0.0, 0.2, 0.9),
        "stribeck": Span(0.0, 0.015 * stall, 0.3 * stall),
        "stribeck_speed": Span(0.001 * idle, 0.025 * idle, 0.25 * idle),
        "source_resistance": Span(0.0, 0.3 * resistance, 2.0 * resistance),
    }


@dataclass(frozen=True, eq=False)
class RolloutModel:
    """One model of a servo.

    Attributes:
        name: what it has, beside what the model before it has.
        fit: to all runs.
        seen: mean absolute position error of the fit in rollouts of its own runs [rad].
        held_out: (folds,) the same in runs that a fit has not seen.
    """

    name: str
    fit: ServoFit
    seen: float
    held_out: FloatArray

    @property
    def error(self) -> float:
        """Mean of the held-out errors [rad]."""
        return float(self.held_out.mean())


@dataclass(frozen=True, eq=False)
class Rollouts:
    """The models of a servo on its logs.

    Attributes:
        models: from few numbers to many.
        held_out: names of the logs that each fold leaves out.
        given: mean absolute position error of the robot as given [rad].
    """

    models: tuple[RolloutModel, ...]
    held_out: tuple[tuple[str, ...], ...]
    given: float

    @property
    def chosen(self) -> RolloutModel:
        """The smallest model whose held-out error is within one standard error of the least.

        Hastie, Tibshirani & Friedman, section 7.10.
        """
        least = min(self.models, key=lambda model: model.error)
        gaps = [model.held_out - least.held_out for model in self.models]
        return next(m for m, gap in zip(self.models, gaps, strict=True) if gap.mean() <= sem(gap))

    def rows(self) -> tuple[TextTable, TextTable]:
        """Return the models with what they miss, and the numbers of the chosen one."""
        fit, models = self.chosen.fit, [("as given", plain(1e3 * self.given, 2), "", "")]
        for model in self.models:
            missed = plain(1e3 * model.seen, 2), plain(1e3 * model.error, 2)
            models.append((model.name, *missed, "chosen" if model is self.chosen else ""))
        numbers = [
            (n, plain(x), UNITS[n].removeprefix("1"), "at its bound" if n in fit.at_bound else "")
            for n, x in fit.values.items()
        ]
        caption = "mean absolute position error; each model has what those above it have"
        heads = "model|>all logs [mrad]|>held out [mrad]|", "number|>value|unit|"
        return TextTable.of(heads[0], models, "", caption), TextTable.of(heads[1], numbers)

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers and texts."""
        models = [
            {
                "name": model.name,
                "seen": model.seen,
                "held_out": model.held_out,
                "numbers": {n: {"value": x, "unit": UNITS[n]} for n, x in model.fit.values.items()},
                "at_bound": model.fit.at_bound,
            }
            for model in self.models
        ]
        told = {"given": self.given, "held_out": self.held_out, "best": self.chosen.name}
        return dict(as_json(told | {"models": models}))


def fit_rollouts(
    robot: Robot, logs: Sequence[Log], progress: Callable[[str], None] = lambda line: None
) -> Rollouts:
    """Return models of a servo, each fitted so that its simulated runs follow the logs.

    The whole servo is simulated from its first position under the recorded target, with the duty,
    current and heat of its winding; nothing of the log is looked at again. Each log may be one of
    another load, gain or supply voltage (`wbc.identification.readings.with_machine`).

    Args:
        robot: with one driven joint, the motor's torque constant, resistance and supply voltage.
        logs: at least two; `position` and `target_position`, and `enabled` if the drive is
            released in between.
        progress: called with a line of text as the work proceeds.

    Raises:
        IdentificationError: another robot, a drive without gain, or fewer than two logs.
        LogError: a channel is missing.
    """
    require_robot_and_logs(robot, logs)
    if len(logs) < 2:
        raise IdentificationError("a rollout is judged on logs held out: give two at least.")
    _require_motor(robot)
    spans, build = _spans(robot), partial(_build, robot)
    runs, folds = [_run(robot, log) for log in logs], _folds(logs)
    parts = [[run for k, run in enumerate(runs) if k not in out] for out in ([], *folds)]
    found: list[RolloutModel] = []
    for name, numbers in MODELS.items():
        progress(name)
        own = {number: spans[number] for number in numbers}
        # Each model starts from the usual numbers, and from those that the smaller one ended at.
        starts = [{}, *(model.fit.values for model in found[-1:])]
        fit, *others = (fit_servo(build, own, part, _STEP, starts, _HOLD) for part in parts)
        held = zip(others, folds, strict=True)
        errors = [np.mean(one.error([runs[k] for k in out], _STEP)) for one, out in held]
        seen = float(np.mean(fit.error(runs, _STEP)))
        found.append(RolloutModel(name, fit, seen, np.array(errors)))
    drive = DcDrive(float(robot.transmission.supply_voltage[0]))
    return Rollouts(
        models=tuple(found),
        held_out=tuple(tuple(logs[k].source.label for k in out) for out in folds),
        given=float(np.mean(ServoFit({}, robot, drive, ()).error(runs, _STEP))),
    )


def _run(robot: Robot, log: Log) -> ServoRun:
    gears = robot.transmission if log.machine is None else log.machine.transmission
    joint, gain = gears.joints[0], float(gears.duty_gain[0])
    if not np.isfinite(gain):
        raise IdentificationError(
            f"{log.source.label}: a rollout needs the duty_gain of the drive in this log. Where "
            "logs have gains of their own, give each its robot file as LOG@ROBOT. To state one, "
            + state_gear(joint, "duty_gain")
        )
    return ServoRun.from_log(log, joint, gain, _STEP)


def _folds(logs: Sequence[Log]) -> list[list[int]]:
    """Return the logs that each fold leaves out: those of one machine, or single ones."""
    kinds = [_setting(log) for log in logs]
    if len(set(kinds)) < 3:
        kinds = [(float(k),) for k in range(len(logs))]
    groups = [[k for k, own in enumerate(kinds) if own == kind] for kind in dict.fromkeys(kinds)]
    count = min(_FOLDS, len(groups))
    return [[k for group in groups[fold::_FOLDS] for k in group] for fold in range(count)]


def _setting(log: Log) -> tuple[float, ...]:
    """Return the numbers in which the machine of a log differs from others."""
    if log.machine is None:
        return ()
    gears = log.machine.transmission
    drive = (gears.duty_gain[0], gears.supply_voltage[0])
    return (*map(float, drive), *map(float, log.machine.inertia))


@dataclass(frozen=True, eq=False)
class ServoFit:
    """A servo fitted to runs.

    Attributes:
        values: the fitted numbers by name.
        robot, drive: built from them.
        at_bound: names of the numbers that ended on a bound.
    """

    values: Mapping[str, float]
    robot: Robot
    drive: DcDrive
    at_bound: tuple[str, ...]

    def error(self, runs: Sequence[ServoRun], step: float) -> FloatArray:
        """Return the mean absolute position error (L,) [rad] in rollouts of `runs`."""
        positions = servo_rollout([(self.robot, self.drive)], runs, step)[:, 0]
        missed = [positions[: run.position.size, k] - run.position for k, run in enumerate(runs)]
        return np.array([np.mean(np.abs(one)) for one in missed])


def fit_servo(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    starts: Sequence[Mapping[str, float]] = ({},),
    hold: float = 0.0,
) -> ServoFit:
    """Return a servo fitted to runs.

    Bounded least squares with a soft-L1 loss; the derivatives are differences, and one rollout
    simulates the variants of all of them.

    Args:
        build: makes robot and drive from the numbers.
        spans: name -> bounds and start.
        runs: measured runs.
        step: time step of the runs [s].
        starts: overrides of the starts; the best fit of all is returned.
        hold: how strongly each number is held to its start in `spans`: doubling it costs as much as
            a single residual of hold [rad]. It only decides what the runs leave open (friction
            against back-EMF, say).

    Raises:
        IdentificationError: nothing to fit, or no run.
    """
    if not spans or not runs:
        raise IdentificationError("fitting a servo needs at least one number and one run.")
    low, center, high = np.array(list(spans.values())).T
    scale = np.maximum(np.abs(center), 0.02 * (high - low))

    def named(x: FloatArray) -> dict[str, float]:
        return dict(zip(spans, map(float, x), strict=True))

    def residuals(points: FloatArray) -> FloatArray:
        """Return the errors (V, rows) of V variants, thinned, run after run, then what holds."""
        positions = servo_rollout([build(named(x)) for x in points], runs, step)
        parts = [
            positions[: run.position.size : _EVERY, :, k] - run.position[::_EVERY, None]
            for k, run in enumerate(runs)
        ]
        return np.hstack([np.concatenate(parts).T, hold / scale * (points - center)])

    def slopes(x: FloatArray) -> FloatArray:
        side = np.where(x + _NUDGE * scale > high, -_NUDGE, _NUDGE) * scale
        here, *near = residuals(np.vstack([x, x + np.diag(side)]))
        return np.asarray((np.stack(near, axis=1) - here[:, None]) / side)

    found = [
        least_squares(
            lambda x: residuals(x[None])[0],
            [start.get(name, span.start) for name, span in spans.items()],
            slopes,
            (low, high),
            x_scale=scale,
            loss="soft_l1",
            f_scale=_SOFT,
            ftol=_ENOUGH,
            max_nfev=_ITERATIONS,
        )
        for start in starts
    ]
    least = min(found, key=lambda one: float(one.cost))
    edge = np.minimum(least.x - low, high - least.x) < 1e-3 * (high - low)
    at_bound = tuple(name for name, close in zip(spans, edge, strict=True) if close)
    values = named(least.x)
    return ServoFit(values, *build(values), at_bound)
