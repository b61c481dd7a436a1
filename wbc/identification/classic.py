"""The classic identification of a robot: every parameter at once, by weighted least squares.

Base parameters of the links, rotor inertias, friction and offsets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import inertial_parameters
from wbc.files import as_json
from wbc.identification.answer.shown import plain, with_interval
from wbc.identification.choice.plain_models import JOINTS
from wbc.identification.model.columns import derivatives, inertial_columns
from wbc.identification.model.estimation_problem import TAIL, EstimationProblem
from wbc.identification.model.residual import evaluate
from wbc.identification.records.record import left_by, output_names, rms, rows_per_sample
from wbc.measurement import Log
from wbc.robot import Effect, Robot
from wbc.robot.coordinates import unit_at
from wbc.tables import FEW, TextTable

_DEPENDENT = 1e-5  # of a column, that must be left beside those before it
_NOTHING = 1e-6  # coefficients between columns of one length, that rounding makes
_SHOWN = 1e-3  # coefficients that are written out

# In pinocchio's order of a link's ten parameters.
_LINK = {"m": "kg"} | dict.fromkeys(("mx", "my", "mz"), "kg m")
_LINK |= dict.fromkeys(("Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"), "kg m^2")


def link_names(robot: Robot) -> list[tuple[str, str, float]]:
    """Return name, unit and value as drawn of all parameters of the links, in order."""
    kinds = [(name, unit, body) for body in robot.bodies for name, unit in _LINK.items()]
    values = inertial_parameters(robot).tolist()
    return [(f"{n} {body}", unit, x) for (n, unit, body), x in zip(kinds, values, strict=True)]


def base_columns(matrix: FloatArray) -> tuple[list[int], FloatArray]:
    """Return the columns that do not depend on those before, and what the others are of them.

    Args:
        matrix: (rows, n).

    Returns:
        numbers of the k independent columns, and (k, n - k) coefficients: each other column is
        the sum of these with the coefficients of its own.
    """
    size = np.sqrt(np.sum(matrix**2, axis=0))
    felt = size > 1e-9 * size.max(initial=1e-300)
    scaled = matrix / np.where(felt, size, 1.0)
    new = np.abs(np.diagonal(np.linalg.qr(scaled[:, felt], mode="r"))) > _DEPENDENT
    kept = np.flatnonzero(felt)[: new.size][new].tolist()
    others = [k for k in range(matrix.shape[1]) if k not in kept]
    mixing = np.linalg.lstsq(scaled[:, kept], scaled[:, others], rcond=None)[0]
    mixing[np.abs(mixing) < _NOTHING] = 0.0
    mixing = mixing * np.where(felt[others], size[others], 0.0) / size[kept][:, None]
    return kept, np.asarray(mixing)


def combination(coefficients: FloatArray, names: Sequence[str]) -> str:
    """Return the terms of a combination as text, the largest first."""
    order = np.argsort(-np.abs(coefficients))
    terms = [f"{coefficients[k]:+.3g} {names[k]}" for k in order if abs(coefficients[k]) > _SHOWN]
    more = [f"and {len(terms) - FEW} more"] if len(terms) > FEW else []
    return " ".join([*terms[:FEW], *more])


@dataclass(frozen=True)
class BaseParameter:
    """A number, or a combination of numbers, that the logs tell.

    Attributes:
        name: such as `viscous_friction at knee`, or `m shin`; mx is mass times centre, Ixx about
            the joint's origin.
        combination: what it stands for beside itself, as text; empty for itself alone.
        value: of the robot with it.
        given: of the robot as given.
        low, high: 90 % interval.
        unit: SI.
    """

    name: str
    combination: str
    value: float
    given: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class ClassicFit:
    """The classic identification.

    Attributes:
        parameters: friction, offsets, rotor inertias and base parameters of the links.
        joints: outputs that were judged.
        before: (outputs,) rms of the robot as given [N m].
        left: (outputs,) rms held out: each fold predicted by a fit without it [N m].
        residual: (rows, outputs) the same, row by row [N m].
        warnings: about the logs.
    """

    parameters: tuple[BaseParameter, ...]
    joints: tuple[str, ...]
    before: FloatArray
    left: FloatArray
    residual: FloatArray
    warnings: tuple[str, ...]

    def rows(self) -> tuple[TextTable, TextTable]:
        """Return the parameters, whose names break and numbers do not, and what is left."""
        cells: list[tuple[str, ...]] = []
        for p in self.parameters:
            value, interval = with_interval(p.value, p.low, p.high)
            cells.append((p.name, value, interval, plain(p.given), p.unit))
            if p.combination:
                cells.append((f"  with {p.combination}",))
        heads = ("~parameter", ">value", "90 % interval", ">as given", "unit")
        left = zip(self.joints, self.before, self.left, strict=True)
        shown = ((joint, f"{before:.3g}", f"{after:.3g}") for joint, before, after in left)
        parameters = TextTable(heads, tuple(cells), whole=True)
        return parameters, TextTable.of("left at|before|after", shown)

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        rows = zip(self.joints, self.before, self.left, strict=True)
        joints = {joint: {"before": one, "after": other} for joint, one, other in rows}
        told = {"parameters": self.parameters, "joints": joints, "warnings": self.warnings}
        return dict(as_json(told))


def identify(robot: Robot, logs: Sequence[Log]) -> ClassicFit:
    """Return all parameters of a robot with perfect gears that its logs tell.

    The residual is linear in all of them. Columns that depend on those before are left out, so that
    the numbers of the links are base parameters (Gautier & Khalil, 1990). Outputs are weighted by
    what a first fit leaves. Nothing is chosen, nothing is bounded: a number may be one that no
    machine has. With torque sensors behind the gears the links and the friction at the joints come
    from what the sensors show, rotors and friction of the motors from the drives beside them.

    Args:
        robot: the robot; losses of its gears are left out.
        logs: one or several of the same machine.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    return classic_fit(EstimationProblem.from_logs(robot.lossless(), logs))


def classic_fit(problem: EstimationProblem) -> ClassicFit:
    """Return the classic fit of a problem whose robot has perfect gears; see `identify`."""
    problem = _sides_apart(problem)
    values, told = _columns(problem)
    target = problem.residual @ problem.whitening
    first, _ = left_by(values.reshape(-1, values.shape[-1]), target.ravel())
    # In floors, and never below one.
    weights = 1.0 / np.maximum(rms(first.reshape(target.shape)), 1.0)
    a = (values * weights[:, None]).reshape(-1, values.shape[-1])
    b = -(target * weights).ravel()
    left, solution = left_by(a, b)
    half = TAIL * np.sqrt(rows_per_sample(problem.records)) * _deviations(a, left)

    def predicted(used: np.ndarray) -> FloatArray:
        rows = np.repeat(used, target.shape[1])
        return np.asarray(target[~used] + values[~used] @ left_by(a[rows], b[rows])[1])

    held = held_out_residual(problem, predicted)
    names, kept = output_names(problem.robot), problem.floor.judged
    numbers = zip(told, solution.tolist(), half.tolist(), strict=True)
    return ClassicFit(
        parameters=tuple(
            BaseParameter(name, text, x := drawn + more, drawn, x - h, x + h, unit)
            for (name, text, drawn, unit), more, h in numbers
        ),
        joints=tuple(names[k] for k in kept),
        before=rms(problem.residual[:, kept]),
        left=rms(held),
        residual=held,
        warnings=problem.warnings,
    )


def _sides_apart(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem with rows behind the gears judged without those of the drives.

    A sensor's noise is in both, so whitening them together would bring what no perfect gear
    explains into the rows that tell the links.
    """
    floor, sensors = problem.floor, len(problem.robot.torque_sensors)
    behind = np.arange(len(floor.covariance)) >= len(floor.covariance) - sensors
    covariance = np.where(np.equal.outer(behind, behind), floor.covariance, 0.0)
    return replace(problem, floor=replace(floor, covariance=covariance))


def held_out_residual(
    problem: EstimationProblem, predicted: Callable[[np.ndarray], FloatArray]
) -> FloatArray:
    """Return (rows, judged outputs) what is left in the outputs' units, each fold held out.

    Args:
        problem: the logs.
        predicted: (rows,) used for the fit -> whitened residual of the others, (rest, outputs).
    """
    left = np.empty((problem.folds.size, problem.whitening.shape[1]))
    for fold in np.unique(problem.folds):
        used = problem.folds != fold
        left[~used] = predicted(used)
    return np.asarray(left @ np.linalg.inv(problem.whitening[problem.floor.judged]))


def _columns(problem: EstimationProblem) -> tuple[FloatArray, list[tuple[str, str, float, str]]]:
    """Return what each parameter changes, whitened, per unit: (rows, outputs, p), and the p.

    Each with its name, what it stands for beside itself, its value as given, and its unit.
    """
    robot, records = problem.robot, problem.records
    effects = [_small(kind, robot, where) for kind in JOINTS for where in kind.places(robot)]
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    at = evaluate(robot, effects, records, problem.whitening)
    joint = derivatives(problem.columns, at, slots, problem.whitening, {})
    joint = joint / np.array([parameter.scale for _, parameter in slots])
    names = []
    for k, p in slots:
        effect, where = effects[k], effects[k].where
        given = effect.null_values(robot, where)[p.name]
        names.append((f"{effect.name} at {where}", unit_at(robot, where, p.unit), given))
    names += link_names(robot)
    links = np.eye(len(names) - len(slots))
    inertial = inertial_columns(robot, records, [None] * len(records), links)
    inertial = np.einsum("rop,oj->rjp", inertial, problem.whitening)
    values = np.concatenate([joint, inertial], axis=-1)
    kept, mixing = base_columns(values.reshape(-1, values.shape[-1]))
    rest = [names[k] for k in range(len(names)) if k not in kept]
    own = mixing @ np.array([value for _, _, value in rest])
    told = []
    for k, more, row in zip(kept, own.tolist(), mixing, strict=True):
        name, unit, value = names[k]
        told.append((name, combination(row, [other for other, _, _ in rest]), value + more, unit))
    return values[:, :, kept], told


def _small(kind: type[Effect], robot: Robot, where: str) -> Effect:
    """Return an effect of a typical size, so that dry friction has a slope."""
    null = kind.null_values(robot, where)
    return kind.at(where, {p.name: null[p.name] + p.scale for p in kind.parameters})


def _deviations(a: FloatArray, left: FloatArray) -> FloatArray:
    """Return (p,) standard deviations, were all rows independent."""
    size = np.sqrt(np.maximum(np.sum(a**2, axis=0), 1e-300))
    inverse = np.linalg.pinv((a / size).T @ (a / size))
    variance = float(left @ left) / max(len(left) - a.shape[1], 1)
    return np.asarray(np.sqrt(variance * np.diagonal(inverse)) / size)
