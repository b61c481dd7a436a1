"""An experiment to plan as plain values, so that it travels to any worker; many of them at once."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.aims import informing
from wbc.design.experiment.causes import parse_cause
from wbc.design.experiment.fourier import FourierPath
from wbc.design.experiment.limits import MotionLimits
from wbc.design.experiment.readable import BAND
from wbc.design.experiment.rivals import Rivals
from wbc.design.experiment.search import Designed, design_experiment, expected, random_paths
from wbc.design.experiment.tied import tied_rivals
from wbc.effects import load_robot
from wbc.errors import DesignError, failure_text
from wbc.progress import Watch
from wbc.results import Column, ResultTable, fill_table
from wbc.robot import Robot
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
        band: [Hz] of torques that the diagnosis will keep.
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
    band: float = BAND
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
        return Rivals(robot, causes, noise, self.band)

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
    classic = plan(aim=informing, climb=False)
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
