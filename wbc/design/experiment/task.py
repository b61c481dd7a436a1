"""An experiment to plan as plain values, so that it travels to any worker; many of them at once.

Its causes are named, or are those that a saved diagnosis could not tell apart.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.aims import informing
from wbc.design.experiment.motions import FourierPath, MotionLimits
from wbc.design.experiment.readable import BAND
from wbc.design.experiment.rivals import (
    Cause,
    Rivals,
    parse_cause,
    require_predictable,
    typical_values,
)
from wbc.design.experiment.search import Designed, design_experiment, expected, random_paths
from wbc.effects import effect_class, load_robot
from wbc.errors import DesignError, failure_text
from wbc.files import take_schema
from wbc.progress import Watch
from wbc.results import Column, ResultTable, fill_table
from wbc.robot import Effect, Robot
from wbc.robot.fingerprint import fingerprint

RANDOM, CLASSIC, DESIGNED = "random, median", "D-optimal", "designed"
_RANDOM = 21  # random motions of which the median one is shown
_SHARE = 0.01  # of the motor's torque limit: the noise of a torque sensor, where none is given
_COLUMNS = {
    "robot": Column(kind="text"),
    "causes": Column(kind="text"),
    "log10_odds_random": Column(),
    "log10_odds_d_optimal": Column(),
    "log10_odds_designed": Column(),
    "used": Column(),
    "path": Column(kind="text"),
    "failure": Column(kind="text"),
}


@dataclass(frozen=True)
class ExperimentTask:
    """What `wbc experiment` is asked for.

    Attributes:
        robot: name or path.
        between: causes as `parse_cause` reads them; left out with `found`.
        found: text of the JSON of a diagnosis, whose tied causes are taken instead.
        lossless: start from perfect gears.
        duration: [s].
        rate: rows per second of the log.
        noise: of the measured rotor torques [N m]; None for 1 % of each motor's torque limit.
        band: [Hz] of torques that the diagnosis of the log will keep; None for that of `found`, or
            `BAND` without one.
        span, speed, acceleration: limits beside the robot's own [rad, m, s].
        rounds: changes tried.
        seed: of the search.
    """

    robot: str
    between: tuple[str, ...] = ()
    found: str = ""
    lossless: bool = False
    duration: float = 10.0
    rate: float = 100.0
    noise: float | None = None
    band: float | None = None
    span: float = np.inf
    speed: float = np.inf
    acceleration: float = np.inf
    rounds: int = 300
    seed: int = 0

    def loaded(self) -> Robot:
        """Return the robot."""
        robot = load_robot(self.robot)
        return robot.lossless() if self.lossless else robot

    def rivals(self, robot: Robot) -> Rivals:
        """Return the causes on the robot.

        Raises:
            DesignError: no noise is given and the motors have no limit to take a share of, causes
                that cannot be compared.
            EffectError: an effect or place that this robot does not have.
        """
        noise = self._noise(robot)
        if self.found:
            return tied_rivals(json.loads(self.found), robot, noise, self.band)
        causes = tuple(parse_cause(text, robot) for text in self.between)
        return Rivals(robot, causes, noise, BAND if self.band is None else self.band)

    def limits(self, robot: Robot) -> MotionLimits:
        """Return what motions stay inside.

        Raises:
            DesignError: a limit that is not positive, or nothing that limits how fast it moves.
        """
        limits = MotionLimits.of(robot, self.span, self.speed, self.acceleration)
        bounded = np.isfinite(limits.speed) | np.isfinite(limits.acceleration)
        if not np.all(bounded | np.isfinite(limits.torque)):
            raise DesignError(
                "nothing limits how fast the robot moves; give --speed, --acceleration, or motors "
                "with a torque_limit."
            )
        return limits

    def _noise(self, robot: Robot) -> FloatArray:
        gears = robot.transmission
        if self.noise is not None:
            return np.full(gears.size, self.noise)
        if not np.isfinite(gears.torque_limit).all():
            raise DesignError("--noise: the motors have no torque_limit to take 1 % of; give it.")
        return np.asarray(_SHARE * gears.torque_limit)


def compare_motions(
    task: ExperimentTask, rivals: Rivals, limits: MotionLimits, watch: Watch | None = None
) -> dict[str, Designed]:
    """Return the designed motion beside the median of random ones and a D-optimal one.

    The D-optimal one is found by changes at random alone, as in the field, and the designed one
    starts from it too.
    """
    drawn = random_paths(rivals, limits, task.duration, task.seed + 1, _RANDOM)
    chance = sorted((expected(rivals, limits, path, task.rate) for path in drawn), key=_said)
    plan = partial(
        design_experiment,
        rivals,
        limits,
        task.duration,
        rate=task.rate,
        rounds=task.rounds,
        seed=task.seed,
        watch=watch,
    )
    classic = plan(aim=replace(informing, climbed=None))
    return {
        RANDOM: chance[_RANDOM // 2],
        CLASSIC: classic,
        DESIGNED: plan(starts=[classic.path]),
    }


def _said(one: Designed) -> float:
    """Return by what random motions are put in order: the least odds, or narrow intervals."""
    return one.worst if one.odds else -one.width


def plan_experiments(
    tasks: Sequence[ExperimentTask],
    out: str | Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    watch: Watch | None = None,
) -> Path:
    """Plan many experiments, one row of a table each, also for one that fails.

    A run that was killed goes on where it ended; the table is then the same to the last bit, as it
    is for any number of workers and on a cluster.

    Args:
        tasks: what to plan.
        out: the Parquet file. Column `path` holds a motion as JSON, `read_path` reads it.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead.
        watch: called with the experiments planned and their total.

    Raises:
        DesignError: no task.
        ResultsError: the file belongs to other work.
        ParallelError: workers is 0, no cluster at the address, or a task that ends its process.
    """
    if not tasks:
        raise DesignError("no experiment is asked for.")
    robots = {task.robot: fingerprint(load_robot(task.robot)) for task in tasks}
    key = {
        "tasks": [json.loads(json.dumps(asdict(task))) for task in tasks],
        "robots": robots,
        "version": version("wbc"),
    }
    table = ResultTable(Path(out), key, _COLUMNS, len(tasks))
    return fill_table(table, planned_row, tasks, workers=workers, cluster=cluster, watch=watch)


def planned_row(task: ExperimentTask) -> dict[str, list[Any]]:
    """Return the row of one experiment; what a worker runs. Any error is a failure of it alone."""
    row: dict[str, Any] = {name: np.nan for name in _COLUMNS}
    row |= {"robot": task.robot, "causes": " | ".join(task.between), "path": "", "failure": ""}
    try:
        robot = task.loaded()
        rivals = task.rivals(robot)
        row["causes"] = " | ".join(
            "+".join(f"{effect.name}@{effect.where}" for effect in cause) for cause in rivals.causes
        )
        row |= _summary(compare_motions(task, rivals, task.limits(robot)))
    except Exception as error:  # whatever one experiment does, the others are planned
        row["failure"] = failure_text(error)
    return {name: [value] for name, value in row.items()}


def _summary(found: Mapping[str, Designed]) -> dict[str, Any]:
    names = {"random": RANDOM, "d_optimal": CLASSIC, "designed": DESIGNED}
    told = {
        f"log10_odds_{name}": found[key].worst / float(np.log(10.0)) if found[key].odds else np.nan
        for name, key in names.items()
    }
    path = found[DESIGNED].path
    written = {
        "center": path.center.tolist(),
        "sine": path.sine.tolist(),
        "cosine": path.cosine.tolist(),
        "frequency": path.frequency,
        "duration": path.duration,
    }
    return {**told, "used": found[DESIGNED].used, "path": json.dumps(written)}


def read_path(text: str) -> FourierPath:
    """Return the motion of column `path` of a table of planned experiments."""
    table = json.loads(text)
    arrays = {name: np.array(table[name]) for name in ("center", "sine", "cosine")}
    return FourierPath(**arrays, frequency=table["frequency"], duration=table["duration"])


_MOST = 4  # causes: pairs grow with the square, and less likely rivals matter less


def tied_causes(found: Mapping[str, Any] | str | Path, robot: Robot) -> tuple[Cause, ...]:
    """Return what a diagnosis found, and the rivals that explain its logs as well.

    Each with all its effects and the parameters that were fitted to the logs. Where nothing ties,
    the rival that came closest. Rivals whose torque no planned motion tells are left out.

    Args:
        found: what `wbc diagnose --json` wrote, or the path of its file.
        robot: the robot that was diagnosed.

    Raises:
        DesignError: a file that cannot be read or holds no diagnosis, one that found nothing, or
            no rival that a planned motion could tell from what was found.
        EffectError: an effect or place that this robot does not have.
    """
    table = found if isinstance(found, Mapping) else read_diagnosis(found)
    own = tuple(_effect(e, robot) for e in _list(table, "effects"))
    if not own:
        raise DesignError(
            f"the diagnosis is '{table.get('verdict')}' and names no effect; there is nothing to "
            "tell apart. Name causes with --between EFFECT@PLACE EFFECT@PLACE."
        )
    rivals = _ranked(table, robot) or _named(table, own, robot)
    causes, refused = [own], ""
    for rival in rivals:
        try:
            for effect in rival:
                require_predictable(effect, robot)
        except DesignError as reason:
            refused = f" ({reason})"
            continue
        if {e.key for e in rival} not in [{e.key for e in cause} for cause in causes]:
            causes.append(rival)
    for effect in own:
        require_predictable(effect, robot)
    if len(causes) < 2:
        raise DesignError(
            f"the diagnosis holds no rival of what it found{refused}. Name causes with --between "
            "EFFECT@PLACE EFFECT@PLACE."
        )
    return tuple(causes[:_MOST])


def tied_rivals(
    found: Mapping[str, Any] | str | Path,
    robot: Robot,
    noise: FloatArray,
    band: float | None = None,
) -> Rivals:
    """Return the `tied_causes` of a diagnosis with what its logs leave open of their values.

    Args:
        found: what `wbc diagnose --json` wrote, or the path of its file.
        robot: the robot that was diagnosed.
        noise: (m,) standard deviation of the measured rotor torque [N m].
        band: [Hz] that the diagnosis of the log will keep of torques; that of `found` when left
            out, or `BAND` where it does not say.

    Raises:
        DesignError: as `tied_causes`, and covariances that do not fit their causes.
        EffectError: an effect or place that this robot does not have.
    """
    table = found if isinstance(found, Mapping) else read_diagnosis(found)
    causes = tied_causes(table, robot)
    covariances = tuple(_covariance(table, cause) for cause in causes)
    if band is None:
        band = float(table.get("band") or BAND)
    return Rivals(robot, causes, noise, band, covariances)


def _covariance(table: Mapping[str, Any], cause: Cause) -> FloatArray | None:
    """Return the covariance that the ranking holds of a cause, None where it holds none."""
    keys = [effect.key for effect in cause]
    for row in table.get("ranking", []):
        listed = [(e["effect"], e["where"]) for e in row.get("effects", [])]
        if listed == keys and row.get("covariance") is not None:
            return np.array(row["covariance"], dtype=np.float64)
    return None


def _ranked(table: Mapping[str, Any], robot: Robot) -> list[Cause]:
    """Return the rivals of the ranking: those that tie, else the closest one."""
    rows = [row for row in table.get("ranking", []) if row.get("effects") and row["added"]]
    instead = [row for row in rows if row["removed"]]
    tied = [row for row in instead if row["standing"] in ("better", "not distinguishable")]
    chosen = tied or instead[:1] or rows[:1]
    return [tuple(_effect(e, robot) for e in row["effects"]) for row in chosen]


def _named(table: Mapping[str, Any], own: Cause, robot: Robot) -> list[Cause]:
    """Return what was found with one effect replaced by an alternative of typical size."""
    rivals = []
    for k, entry in enumerate(_list(table, "effects")):
        for other in entry.get("alternatives", []):
            values = dict(effect_class(other["effect"]).null_values(robot, other["where"]))
            instead = _effect(
                {**other, "parameters": typical_values(other["effect"], values)}, robot
            )
            rivals.append((*own[:k], instead, *own[k + 1 :]))
    return rivals


def _effect(entry: Mapping[str, Any], robot: Robot) -> Effect:
    try:
        name, where = entry["effect"], entry["where"]
        values = {
            key: float(number["value"] if isinstance(number, Mapping) else number)
            for key, number in entry["parameters"].items()
        }
    except (KeyError, TypeError, ValueError) as cause:
        raise DesignError(f"--between: an effect of the diagnosis lacks {cause}.") from cause
    effect = effect_class(name).at(where[0] if isinstance(where, list) else where, values)
    effect.check_place(robot)
    return effect


def _list(table: Mapping[str, Any], key: str) -> Sequence[Mapping[str, Any]]:
    entries = table.get(key)
    if not isinstance(entries, list):
        raise DesignError(
            "--between: this JSON is no diagnosis; give what `wbc diagnose --json FILE` wrote."
        )
    return entries


def read_diagnosis(path: str | Path) -> Mapping[str, Any]:
    """Return what `wbc diagnose --json` wrote.

    Raises:
        DesignError: a file that cannot be read, is no table, or was written by a newer wbc.
    """
    try:
        table = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as cause:
        raise DesignError(f"--between '{path}' cannot be read as JSON: {cause}.") from cause
    if not isinstance(table, dict):
        raise DesignError(f"--between '{path}' is no diagnosis.")
    if reason := take_schema(table):
        raise DesignError(f"--between '{path}': {reason}.")
    return table
