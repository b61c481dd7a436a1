"""A position servo fitted by output error: models from few numbers to many, on whole runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects.friction import CoulombFriction, StribeckFriction, ViscousFriction
from wbc.effects.gear_losses import LoadFriction
from wbc.effects.links import GravityDirection
from wbc.errors import IdentificationError
from wbc.files import as_json
from wbc.identification.records.log_checks import require_robot_and_logs
from wbc.measurement import Log
from wbc.robot import Effect, Robot, state_gear
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

_FRICTION = ("torque_constant", "resistance", "rotor_inertia", "tilt", "coulomb", "viscous")
_STRIBECK = (*_FRICTION, "load", "stribeck", "stribeck_speed")
MODELS: dict[str, tuple[str, ...]] = {
    "Coulomb and viscous friction": _FRICTION,
    "and load friction": (*_FRICTION, "load"),
    "and Stribeck friction": _STRIBECK,
    "and supply sag": (*_STRIBECK, "source_resistance"),
}
"""Name of a model -> its numbers; each holds those of the one before."""

UNITS = {
    "torque_constant": "N m/A",
    "resistance": "ohm",
    "rotor_inertia": "kg m^2",
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


@dataclass(frozen=True, eq=False)
class ServoModels:
    """The models of one servo.

    Attributes:
        robot: as it was given, with one driven joint and the numbers of its motor.
        spans: bounds and start of each number.
        axis: (3,) of the joint at its zero, world.
    """

    robot: Robot
    spans: Mapping[str, Span]
    axis: np.ndarray

    @classmethod
    def of(cls, robot: Robot) -> ServoModels:
        """Return the models of a robot.

        Bounds and starts are shares of the motor's stall torque and idle speed; those of the
        recorded XL330 servo.

        Raises:
            IdentificationError: more than one joint, or a motor without its numbers.
        """
        gears = robot.transmission
        if robot.model.nv != 1 or gears.size != 1:
            raise IdentificationError(
                f"'{robot.name}' has {robot.model.nv} joints; a rollout of a servo is for one "
                "driven joint. Lock the others in robot.toml."
            )
        lacking = [
            name
            for name in ("torque_constant", "resistance", "supply_voltage")
            if not np.isfinite(getattr(gears, name)[0])
        ]
        if lacking:
            raise IdentificationError(
                f"'{robot.name}': a rollout needs the motor's {', '.join(lacking)}; "
                + state_gear(gears.joints[0], *lacking)
            )
        return cls(robot, _spans(robot), _axis(robot))

    def build(self, values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
        """Return robot and drive with these numbers; what is not given is not there."""
        gears = self.robot.transmission
        joint, ratio = gears.joints[0], float(gears.gear_ratio[0])
        changed = gears.replace(
            torque_constant=[values["torque_constant"]],
            resistance=[values["resistance"]],
            rotor_inertia=[values["rotor_inertia"] / ratio**2],
        )
        robot = self.robot.with_transmission(changed).with_effects(*self.effects(values, joint))
        supply = float(gears.supply_voltage[0])
        return robot, DcDrive(supply, source_resistance=values.get("source_resistance", 0.0))

    def effects(self, values: Mapping[str, float], joint: str) -> list[Effect]:
        """Return the effects that numbers stand for."""
        roll, pitch = (float(values["tilt"] * share) for share in self.axis[:2])
        found: list[Effect] = [
            GravityDirection("robot", roll, pitch),
            CoulombFriction(joint, values["coulomb"]),
            ViscousFriction(joint, values["viscous"]),
        ]
        if "load" in values:
            found.append(LoadFriction(joint, values["load"]))
        if "stribeck" in values:
            found.append(StribeckFriction(joint, values["stribeck"], values["stribeck_speed"]))
        return found

    def of_model(self, name: str) -> dict[str, Span]:
        """Return the spans of one model's numbers."""
        return {number: self.spans[number] for number in MODELS[name]}


def _spans(robot: Robot) -> dict[str, Span]:
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


def _axis(robot: Robot) -> np.ndarray:
    """Return the direction (3,) of the joint in the world, by which gravity may be tilted."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, robot.neutral())
    jacobian = pin.getJointJacobian(robot.model, data, 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    return np.asarray(jacobian).reshape(6, -1)[3:, 0]


def firsts(names: Sequence[str], fitted: Mapping[str, float] | None) -> list[dict[str, float]]:
    """Return the starts of a fit: the usual ones, and those that a smaller model ended at."""
    if fitted is None:
        return [{}]
    return [{}, {name: fitted[name] for name in names if name in fitted}]


_STEP = 0.005  # [s]
_FOLDS = 6
_ITERATIONS = 25
_HOLD = 0.1  # [rad] of one residual that doubling a number costs which the runs leave open


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
        robot: as it was given.
        models: from few numbers to many.
        best: number of the smallest model whose held-out error is within one standard error of the
            least (Hastie, Tibshirani & Friedman, section 7.10).
        held_out: names of the logs that each fold leaves out.
        given: mean absolute position error of the robot as given [rad].
    """

    robot: Robot
    models: tuple[RolloutModel, ...]
    best: int
    held_out: tuple[tuple[str, ...], ...]
    given: float

    @property
    def chosen(self) -> RolloutModel:
        """The model that the held-out errors ask for."""
        return self.models[self.best]

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects of the chosen model."""
        return self.chosen.fit.robot.effects

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers and texts."""
        models = [
            {
                "name": model.name,
                "seen": model.seen,
                "held_out": model.held_out,
                "numbers": {
                    name: {"value": value, "unit": UNITS[name]}
                    for name, value in model.fit.values.items()
                },
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
    models = ServoModels.of(robot)
    runs = [_run(robot, log) for log in logs]
    folds = _folds(logs)
    subsets = [[k for k in range(len(runs)) if k not in out] for out in ([], *folds)]
    found: list[RolloutModel] = []
    for name, numbers in MODELS.items():
        progress(name)
        fits = fit_servos(
            models.build,
            models.of_model(name),
            runs,
            _STEP,
            subsets,
            firsts(numbers, found[-1].fit.values if found else None),
            _ITERATIONS,
            _HOLD,
        )
        errors = [
            np.mean(fit.error([runs[k] for k in out], _STEP))
            for fit, out in zip(fits[1:], folds, strict=True)
        ]
        seen = float(np.mean(fits[0].error(runs, _STEP)))
        found.append(RolloutModel(name, fits[0], seen, np.array(errors)))
    return Rollouts(
        robot=robot,
        models=tuple(found),
        best=_smallest(found),
        held_out=tuple(tuple(logs[k].source.label for k in out) for out in folds),
        given=_as_given(models, runs),
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
    settings = [_setting(log) for log in logs]
    kinds = list(dict.fromkeys(settings))
    if len(kinds) > 2:
        groups = [[k for k, own in enumerate(settings) if own == kind] for kind in kinds]
    else:
        groups = [[k] for k in range(len(logs))]
    count = min(_FOLDS, len(groups))
    return [[k for group in groups[fold::_FOLDS] for k in group] for fold in range(count)]


def _setting(log: Log) -> tuple[float, ...]:
    """Return the numbers in which the machine of a log differs from others."""
    if log.machine is None:
        return ()
    gears = log.machine.transmission
    drive = (gears.duty_gain[0], gears.supply_voltage[0])
    return (*map(float, drive), *map(float, log.machine.inertia))


def _smallest(models: Sequence[RolloutModel]) -> int:
    """Return the first model within one standard error of the least held-out error."""
    least = min(models, key=lambda model: model.error)
    for k, model in enumerate(models):
        gap = model.held_out - least.held_out
        doubt = float(np.std(gap, ddof=1) / np.sqrt(gap.size)) if gap.size > 1 else 0.0
        if gap.mean() <= doubt:
            return k
    return models.index(least)


def _as_given(models: ServoModels, runs: Sequence[ServoRun]) -> float:
    gears = models.robot.transmission
    values = {
        "torque_constant": float(gears.torque_constant[0]),
        "resistance": float(gears.resistance[0]),
        "rotor_inertia": float(gears.reflected_inertia[0]),
        "tilt": 0.0,
        "coulomb": 0.0,
        "viscous": 0.0,
    }
    robot, drive = models.build(values)
    return float(np.mean(ServoFit(values, robot, drive, 0.0, ()).error(runs, _STEP)))


class Span(NamedTuple):
    """Bounds and start of one number."""

    low: float
    start: float
    high: float


Build = Callable[[Mapping[str, float]], tuple[Robot, DcDrive]]


@dataclass(frozen=True, eq=False)
class ServoFit:
    """A servo fitted to runs.

    Attributes:
        values: the fitted numbers by name.
        robot, drive: built from them.
        cost: of the fit, to compare starts.
        at_bound: names of the numbers that ended on a bound.
    """

    values: Mapping[str, float]
    robot: Robot
    drive: DcDrive
    cost: float
    at_bound: tuple[str, ...]

    def error(self, runs: Sequence[ServoRun], step: float) -> FloatArray:
        """Return the mean absolute position error (L,) [rad] in rollouts of `runs`."""
        positions = servo_rollout([(self.robot, self.drive)], runs, step)[:, 0]
        missed = [positions[: run.position.size, k] - run.position for k, run in enumerate(runs)]
        return np.array([np.mean(np.abs(one)) for one in missed])


def fit_servos(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    subsets: Sequence[Sequence[int]],
    starts: Sequence[Mapping[str, float]] = ({},),
    iterations: int = 40,
    hold: float = 0.0,
) -> list[ServoFit]:
    """Return one fit for each subset of the runs.

    Bounded least squares with a soft-L1 loss; the derivatives are differences. All fits go in
    step, so that one rollout simulates the variants of all of them: the fits of a
    cross-validation cost little more than one.

    Args:
        build: makes robot and drive from the numbers.
        spans: name -> bounds and start.
        runs: measured runs.
        step: time step of the runs [s].
        subsets: rows of `runs` that each fit sees.
        starts: overrides of the starts; the best fit of all is returned.
        iterations: of one fit, at most.
        hold: how strongly each number is held to its start in `spans`: doubling it costs as much as
            a single residual of hold [rad]. It only decides what the runs leave open (friction
            against back-EMF, say).

    Raises:
        IdentificationError: nothing to fit, or no run.
    """
    if not spans or not subsets or any(len(subset) == 0 for subset in subsets):
        raise IdentificationError("fitting a servo needs at least one number and one run.")
    names, table = list(spans), np.array([tuple(span) for span in spans.values()])
    low, center, high = table.T
    scale = np.maximum(np.abs(center), 0.02 * (high - low))
    firsts = [np.array([start.get(name, spans[name].start) for name in names]) for start in starts]
    row_of = np.concatenate([np.full(len(r.position[::_EVERY]), k) for k, r in enumerate(runs)])
    seen = np.array([np.isin(range(len(runs)), subset) for subset in subsets for _ in firsts])

    def residuals(points: FloatArray, tasks: Sequence[int]) -> FloatArray:
        """Return the errors (V, rows) of V variants, thinned, run after run, then what holds."""
        servos = [build(dict(zip(names, map(float, p), strict=True))) for p in points]
        positions = servo_rollout(servos, runs, step, seen[list(tasks)])
        parts = [
            positions[: run.position.size : _EVERY, :, k] - run.position[::_EVERY, None]
            for k, run in enumerate(runs)
        ]
        return np.hstack([np.concatenate(parts).T, hold / scale * (points - center)])

    held = np.ones(len(names), dtype=bool)
    tasks = [
        FitStart(first, np.concatenate([np.isin(row_of, subset), held]))
        for subset in subsets
        for first in firsts
    ]
    found = lockstep_fit(residuals, tasks, (low, high), scale, _SOFT, iterations)
    best = []
    for k in range(len(subsets)):
        x, cost = min(found[k * len(firsts) : (k + 1) * len(firsts)], key=lambda one: one[1])
        edge = np.minimum(x - low, high - x) < 1e-3 * (high - low)
        values = dict(zip(names, map(float, x), strict=True))
        at_bound = tuple(name for name, close in zip(names, edge, strict=True) if close)
        best.append(ServoFit(values, *build(values), cost, at_bound))
    return best


_STEP = 1e-3  # of the differences, in scales: small beside a fit's own uncertainty
_TRIES = (0.1, 1.0, 10.0)  # dampings tried at once, times the present one
_ENOUGH = 1e-4  # relative fall of the cost below which an iteration has gained nothing


class FitStart(NamedTuple):
    """Where one fit starts, (n,), and the rows (R,) of the residual that it sees."""

    first: FloatArray
    rows: npt.NDArray[np.bool_]


class _Point(NamedTuple):
    """Numbers of a fit, the residual that it sees and its cost there."""

    x: FloatArray
    residual: FloatArray
    cost: float


def lockstep_fit(
    residuals: Callable[[FloatArray, Sequence[int]], FloatArray],
    tasks: Sequence[FitStart],
    bounds: tuple[FloatArray, FloatArray],
    scale: FloatArray,
    soft: float,
    iterations: int,
) -> list[tuple[FloatArray, float]]:
    """Return (numbers (n,), cost) of each task, by Levenberg-Marquardt steps taken together.

    The cost is the sum of soft^2 (sqrt(1 + (r / soft)^2) - 1) over the residuals r of a task; a
    number whose bound the cost pushes against is kept there (gradient projection). Several
    dampings are tried at once, so that hardly an iteration is lost to a step that jumps (dry
    friction makes such costs rough).

    Args:
        residuals: (V, n) numbers and the task (V,) of each -> (V, R) residuals; rows that the
            task does not see are not read.
        tasks: the fits.
        bounds: low and high, (n,) each.
        scale: typical sizes of the numbers, (n,), > 0.
        soft: residual from which on it counts linearly.
        iterations: at most.
    """
    low, high = bounds
    idle = np.zeros(len(tasks), dtype=int)
    damping = np.full(len(tasks), 1e-2)

    def points(xs: FloatArray, of: Sequence[int]) -> list[_Point]:
        table = residuals(xs, of)
        seen = [row[tasks[k].rows] for row, k in zip(table, of, strict=True)]
        losses = [soft**2 * np.sum(np.sqrt(1.0 + (r / soft) ** 2) - 1.0) for r in seen]
        return [_Point(x, r, float(c)) for x, r, c in zip(xs, seen, losses, strict=True)]

    at = points(np.stack([np.clip(t.first, low, high) for t in tasks]), range(len(tasks)))
    for _ in range(iterations):
        active = [k for k in range(len(tasks)) if idle[k] < 2]
        if not active:
            break
        sides = [np.where(at[k].x + _STEP * scale > high, -_STEP, _STEP) * scale for k in active]
        moved = [at[k].x + np.diag(side) for k, side in zip(active, sides, strict=True)]
        around = points(np.concatenate(moved), np.repeat(active, scale.size).tolist())
        tries: list[FloatArray] = []
        for place, (k, side) in enumerate(zip(active, sides, strict=True)):
            near = around[place * scale.size : (place + 1) * scale.size]
            slopes = np.stack([p.residual - at[k].residual for p in near], axis=1) / side * scale
            weights = 1.0 / np.sqrt(1.0 + (at[k].residual / soft) ** 2)
            limits = (low - at[k].x) / scale, (high - at[k].x) / scale
            steps = _steps(slopes, weights, at[k].residual, limits, damping[k] * np.array(_TRIES))
            tries.extend(np.clip(at[k].x + scale * step, low, high) for step in steps)
        reached = points(np.stack(tries), np.repeat(active, len(_TRIES)).tolist())
        for place, k in enumerate(active):
            options = reached[place * len(_TRIES) : (place + 1) * len(_TRIES)]
            best = min(range(len(_TRIES)), key=lambda i: options[i].cost)
            gain = 1.0 - options[best].cost / max(at[k].cost, 1e-300)
            idle[k] = 0 if gain > _ENOUGH else idle[k] + 1
            damping[k] = np.clip(damping[k] * (_TRIES[best] if gain > 0.0 else 30.0), 1e-8, 1e6)
            at[k] = options[best] if gain > 0.0 else at[k]
    return [(point.x, point.cost) for point in at]


def _steps(
    slopes: FloatArray,
    weights: FloatArray,
    residual: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    dampings: FloatArray,
) -> list[FloatArray]:
    """Return one step (n,) in scales for each damping; blocked numbers stay."""
    gradient = slopes.T @ (weights * residual)
    square = slopes.T @ (weights[:, None] * slopes)
    blocked = ((limits[0] >= 0.0) & (gradient > 0.0)) | ((limits[1] <= 0.0) & (gradient < 0.0))
    free = np.flatnonzero(~blocked)
    diagonal = np.diag(square)
    steps = []
    for damping in dampings:
        step = np.zeros(gradient.size)
        extra = damping * np.maximum(diagonal, 1e-9 * diagonal.max(initial=1e-300))
        matrix = (square + np.diag(extra + 1e-300))[np.ix_(free, free)]
        step[free] = -np.linalg.lstsq(matrix, gradient[free], rcond=None)[0]
        steps.append(step)
    return steps
