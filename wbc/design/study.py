"""A study: which designs of which robot are evaluated how, its table, and the best compromises.

What it varies are parameters of the gears and joints, and gearboxes of a catalogue: a table
of numbers with their sources.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.effects import load_robot
from wbc.errors import DesignError, needs, require_known, unknown_name
from wbc.files import atomic_write
from wbc.metrics import DesignMetrics, Designs, design_metrics, with_contact_at
from wbc.metrics.designs import GEAR_FIELDS
from wbc.parallel import Watch
from wbc.robot import Robot
from wbc.transmission import GEAR_NUMBERS, wedge_backward_efficiency

_CALLED = {"gear_ratio": "reduction", "rotor_coulomb_friction": "rotor_friction"}
GEAR_PARAMETERS = {_CALLED.get(field, field): field for field in GEAR_FIELDS}
NAMES = (*GEAR_PARAMETERS, "joint")
_OTHER_UNITS = {"joint": "rad or m", "gearbox": "1"}
DEFAULT_COUNT = 9  # values on a grid of a range that names no number: a table to read, not to trust
_CHUNK = 4096  # designs at once: their arrays stay in the cache of the processor


@dataclass(frozen=True)
class SweepParameter:
    """One parameter of a study.

    Attributes:
        name: one of `NAMES`, or "gearbox" (by its number) where a study makes it.
        place: joint of a gear (all gears alike when empty), or joint.
        values: that it takes.
        logarithmic: whether they are even in the logarithm.
    """

    name: str
    place: str
    values: tuple[float, ...]
    logarithmic: bool = False

    def __post_init__(self) -> None:
        """Check names and values."""
        if self.name not in (*NAMES, "gearbox"):
            raise DesignError(unknown_name("parameter", self.name, NAMES))
        if self.name == "joint" and not self.place:
            raise DesignError("joint: name the joint, as in joint.NAME=LOW:HIGH.")
        if not self.values or not np.isfinite(self.values).all():
            raise DesignError(f"{self.column} needs at least 1 value, and all of them finite.")

    @property
    def column(self) -> str:
        """Name of the parameter's column in the table."""
        return f"{self.name}.{self.place}" if self.place else self.name

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return _OTHER_UNITS.get(self.name) or GEAR_NUMBERS[GEAR_PARAMETERS[self.name]].unit


def parse_sweep(text: str) -> SweepParameter:
    """Return the parameter of `NAME[.PLACE]=LOW:HIGH[:COUNT][:log]` or `NAME[.PLACE]=V,V,...`.

    Raises:
        DesignError: text of another form, an unknown name, no range.
    """
    left, equals, right = text.partition("=")
    name, _, place = left.strip().partition(".")
    if name == "gearbox":
        raise DesignError(unknown_name("parameter", name, NAMES))
    form = "use NAME=LOW:HIGH, NAME=LOW:HIGH:COUNT, NAME=LOW:HIGH:COUNT:log or NAME=V,V,..."
    if not equals or not right.strip():
        raise DesignError(f"--sweep '{text}': {form}.")
    try:
        if ":" not in right:
            return SweepParameter(name, place, tuple(float(value) for value in right.split(",")))
        parts = right.split(":")
        logarithmic = parts[-1].strip() == "log"
        numbers = parts[:-1] if logarithmic else parts
        if len(numbers) not in (2, 3):
            raise DesignError(f"--sweep '{text}': {form}.")
        low, high = float(numbers[0]), float(numbers[1])
        count = int(numbers[2]) if len(numbers) == 3 else DEFAULT_COUNT
        if not -np.inf < low <= high < np.inf:
            raise DesignError(f"--sweep '{text}': {low:g}:{high:g} is no range.")
        if logarithmic and low <= 0.0:
            raise DesignError(f"--sweep '{text}': a logarithmic range must start above 0.")
        grid = (np.geomspace if logarithmic else np.linspace)(low, high, count)
    except ValueError as cause:
        raise DesignError(f"--sweep '{text}': {cause}; {form}.") from cause
    return SweepParameter(name, place, tuple(grid.tolist()), logarithmic)


_NUMBERS = ("reduction", "forward_efficiency", "backward_efficiency", "gear_inertia")


@dataclass(frozen=True)
class Gearbox:
    """One row of the catalogue.

    Attributes:
        name: unique in the table.
        kind: planetary, cycloidal, strain wave, direct drive, ...
        reduction: N.
        forward_efficiency, backward_efficiency: the motor drives the joint, the joint the motor.
        gear_inertia: of the gearbox at the motor's shaft [kg m^2]; it adds to the rotor's.
        source: where the numbers stand.

    A number that no source gives is None.
    """

    name: str
    kind: str
    reduction: float | None
    forward_efficiency: float | None
    backward_efficiency: float | None
    gear_inertia: float | None
    source: str

    @property
    def unknown(self) -> tuple[str, ...]:
        """Names of the numbers that no source gives."""
        return tuple(name for name in _NUMBERS if getattr(self, name) is None)


def read_gearboxes() -> dict[str, Gearbox]:
    """Return the catalogue by name."""
    text = Path(__file__).with_name("gearboxes.csv").read_text(encoding="utf-8")
    rows: list[dict[str, Any]] = list(csv.DictReader(text.splitlines()))
    for row in rows:
        row |= {name: float(row[name]) if row[name] else None for name in _NUMBERS}
    return {row["name"]: Gearbox(**row) for row in rows}


def choose_gearboxes(names: str, catalogue: Mapping[str, Gearbox]) -> tuple[Gearbox, ...]:
    """Return the gearboxes of `NAME,NAME,...`; `all` stands for those with a forward efficiency.

    Raises:
        DesignError: an unknown name.
    """
    if names == "all":
        return tuple(box for box in catalogue.values() if box.forward_efficiency is not None)
    chosen = [name.strip() for name in names.split(",")]
    for name in chosen:
        require_known(DesignError, "gearbox", name, catalogue)
    return tuple(catalogue[name] for name in chosen)


_UNITS = {
    **dict.fromkeys(("inertia", "backward_inertia", "forward_inertia"), "kg"),
    **dict.fromkeys(("conventional", "lift", "hold", "backdriving_force"), "N"),
    **dict.fromkeys(("holding_torque", "holding_torque_lossless"), "N m"),
}


@dataclass(frozen=True)
class Study:
    """Designs of one robot: a full grid of the parameters.

    Attributes:
        robot: shipped robot's name or path of its description.
        parameters: what varies.
        contact: name of the contact point, or of a frame whose origin stands in for one.
        position: q of the pose that the designs share.
        axes: world axes; one-direction metrics go along `direction`.
        direction: along `axes`.
        load: force to hold [N], None for the robot's weight.
        gearboxes: of a catalogue; each is one more design, for all gears alike. What a row leaves
            out stays the robot's own or what is swept; without a backward efficiency it is the
            wedge's 2 - 1/eta_f.
    """

    robot: str
    parameters: tuple[SweepParameter, ...]
    contact: str
    position: tuple[float, ...]
    axes: str = "xz"
    direction: tuple[float, ...] = (0.0, 1.0)
    load: float | None = None
    gearboxes: tuple[Gearbox, ...] = ()

    def __post_init__(self) -> None:
        """Check names and the kind of robot; the values are checked with the first designs."""
        columns = [parameter.column for parameter in self.varied]
        if not columns:
            raise DesignError("a study varies at least one parameter; give --sweep NAME=LOW:HIGH.")
        if len(set(columns)) != len(columns):
            raise DesignError(f"a parameter is swept twice: {', '.join(columns)}.")
        if not 0.0 <= (self.load or 0.0) < np.inf:
            raise DesignError(f"the load must be >= 0 and finite, got {self.load}.")
        robot = loaded(self.robot, self.contact)
        for p in filter(lambda parameter: parameter.place, self.parameters):
            joints = robot.single_joints if p.name == "joint" else robot.transmission.joints
            require_known(DesignError, "place", p.place, joints, p.column)

    @property
    def varied(self) -> tuple[SweepParameter, ...]:
        """All that varies: gearboxes by number, and the parameters."""
        boxes = tuple(float(number) for number in range(len(self.gearboxes)))
        if not boxes:
            return self.parameters
        return (SweepParameter("gearbox", "", boxes), *self.parameters)

    @property
    def size(self) -> int:
        """Number of designs."""
        return int(np.prod([len(parameter.values) for parameter in self.varied]))

    def values(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Return the parameters of designs `start` to before `stop` by column."""
        grids = [np.array(parameter.values) for parameter in self.varied]
        places = np.unravel_index(np.arange(start, stop), [len(grid) for grid in grids])
        columns = zip(self.varied, grids, places, strict=True)
        return {p.column: grid[place] for p, grid, place in columns}

    def designs(self, start: int, stop: int) -> Designs:
        """Return designs `start` to before `stop`.

        Raises:
            DynamicsError, TransmissionError: a value outside its range.
        """
        robot, values = loaded(self.robot, self.contact), self.values(start, stop)
        gears, count = robot.transmission, stop - start
        moves = any(p.name == "joint" for p in self.parameters)
        q = np.tile(self.position, (count if moves else 1, 1))
        told: dict[str, FloatArray] = {}

        def tell(field: str, numbers: FloatArray, own: list[int] | slice = slice(None)) -> None:
            told.setdefault(field, np.full((count, gears.size), np.nan))[:, own] = numbers

        if self.gearboxes:
            rows = values["gearbox"].astype(np.int_)
            columns = [[getattr(box, name) for box in self.gearboxes] for name in _NUMBERS]
            reduction, forward, backward, inertia = np.array(columns, dtype=float)[:, rows, None]
            tell("gear_ratio", np.sign(gears.gear_ratio) * reduction)
            tell("rotor_inertia", gears.rotor_inertia + inertia)
            tell("forward_efficiency", forward)
            tell("backward_efficiency", backward)
        for p in self.parameters:
            if p.name == "joint":
                q[:, robot.position_index(p.place)] = values[p.column]
            else:
                own = [gears.index(p.place)] if p.place else slice(None)
                tell(GEAR_PARAMETERS[p.name], values[p.column][:, None], own)
        given = {n: np.where(np.isnan(x), getattr(gears, n), x) for n, x in told.items()}
        if "forward_efficiency" in told:
            # A forward efficiency alone brings the wedge's backward one.
            alone = np.isnan(told.get("backward_efficiency", np.nan))
            alone = alone & ~np.isnan(told["forward_efficiency"])
            wedge = wedge_backward_efficiency(given["forward_efficiency"])
            stated = given.get("backward_efficiency", gears.backward_efficiency)
            given["backward_efficiency"] = np.where(alone, wedge, stated)
        return Designs.of(robot, q, given)

    def evaluate(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Return the table of designs `start` to before `stop` by column."""
        table = {"design": np.arange(float(start), stop), **self.values(start, stop)}
        where = self.contact, self.direction, self.axes, self.load
        return table | vars(design_metrics(self.designs(start, stop), *where))


def describe_columns(study: Study) -> dict[str, str]:
    """Return the unit of every column of a study's table, in order."""
    metrics = {field.name: _UNITS.get(field.name, "1") for field in fields(DesignMetrics)}
    return {"design": "1", **{p.column: p.unit for p in study.varied}, **metrics}


@lru_cache(maxsize=8)
def loaded(robot: str, contact: str) -> Robot:
    """Return a robot with a contact or frame called `contact`, read once."""
    return with_contact_at(load_robot(robot), contact)


@dataclass(frozen=True)
class Objective:
    """A column of the table and whether more of it is better."""

    column: str
    more: bool = True

    def cost(self, table: Mapping[str, FloatArray]) -> FloatArray:
        """Return the column as something to make small; infinitely bad where it is NaN."""
        values = np.asarray(table[self.column], dtype=np.float64)
        return np.where(np.isnan(values), np.inf, -values if self.more else values)


def parse_objective(text: str, columns: Sequence[str]) -> Objective:
    """Return the objective of `COLUMN:max` or `COLUMN:min`.

    Raises:
        DesignError: text of another form, or no such column.
    """
    column, _, way = text.strip().partition(":")
    require_known(DesignError, "objective", column, columns)
    if way not in ("max", "min"):
        raise DesignError(f"objective '{text}': use {column}:max or {column}:min.")
    return Objective(column, way == "max")


def pareto_front(table: Mapping[str, FloatArray], objectives: Sequence[Objective]) -> IntArray:
    """Return the rows that no other row beats, best in the first objective first.

    A row is beaten by one that is at least as good in every objective and better in one; of equal
    rows all stay. Rows with a NaN objective never count.

    Raises:
        DesignError: no objective.
    """
    if not objectives:
        raise DesignError("a Pareto front needs at least one objective.")
    costs = np.stack([objective.cost(table) for objective in objectives], axis=1)
    usable = np.flatnonzero((costs < np.inf).all(axis=1))
    # Whoever beats a row comes before it in this order, so that one pass over the front suffices.
    order = usable[np.lexsort(costs[usable].T[::-1])]
    if len(objectives) <= 2:
        return order[~_beaten_in_order(costs[order, 0], costs[order, -1])]
    front, left = list[int](), np.ascontiguousarray(costs[order].T)
    while order.size:
        front.append(order[0])
        best = left[:, :1]
        kept = (left < best).any(axis=0) | (left == best).all(axis=0)
        kept[0] = False
        order, left = order[kept], left[:, kept]
    return np.array(front, dtype=np.int_)


def _beaten_in_order(first: FloatArray, second: FloatArray) -> BoolArray:
    """Return which rows (n,) of two costs some other beats; sorted by the first, then the second.

    A row is beaten by one with a smaller first cost and no larger second one, or with the same
    first cost and a smaller second one: one pass instead of all pairs.
    """
    begins = np.searchsorted(first, first)  # first row of those with the same first cost
    least = np.concatenate([[np.inf], np.minimum.accumulate(second)])[begins]
    return np.asarray((least <= second) | (second[begins] < second))


def run_study(
    study: Study, path: str | Path, watch: Watch = lambda done, total: None
) -> dict[str, FloatArray]:
    """Evaluate every design of a study, write the table, and return its columns.

    Args:
        study: what to evaluate.
        path: the Parquet file, written whole or not at all; its columns hold their units.
        watch: called with the designs done and their total, now and after every chunk.

    Raises:
        MissingPackageError: pyarrow is not installed.
        DynamicsError, TransmissionError: a value outside its range.
    """
    with needs("design", "a table of designs"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    parts = []
    for start in range(0, study.size, _CHUNK):
        watch(start, study.size)
        parts.append(study.evaluate(start, min(start + _CHUNK, study.size)))
    watch(study.size, study.size)
    units = describe_columns(study)
    table = {name: np.concatenate([part[name] for part in parts]) for name in units}
    schema = pa.schema(
        pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit in units.items()
    )
    atomic_write(path, lambda file: pq.write_table(pa.table(table, schema=schema), file))
    return table
