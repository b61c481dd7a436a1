"""A validated time series, and what checks find in it. Immutable: a change is a new log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbc.arrays import FloatArray, IntArray, Remade, frozen
from wbc.errors import LogError, require_known, unknown_name
from wbc.measurement import schema
from wbc.measurement.clocks import LEAST_ROWS, advancing, gaps
from wbc.measurement.column_map import Mend, say_so
from wbc.measurement.names import unread
from wbc.robot import Robot
from wbc.tables import few, joined
from wbc.transmission import Transmission

_NAMED = 8  # columns in a representation


@dataclass(frozen=True)
class LogSource:
    """Provenance of a log: enough to find it again and to know what was done on the way in.

    Attributes:
        path: the file, empty for a log made in memory.
        sha256: digest of the whole file, empty for a log made in memory.
        part: which log of the file, when it holds several.
        mapping: path of the column map that was used, empty for none.
        ignored: columns of the file that were not read because no name of the schema fits them.
        notes: what else was changed while reading (rows dropped, columns left out).
        unusable: channels that were left out because they hold NaN -> where, and the way out.
        holes: the same channels -> what a map says of `missing` so that they can be used.
        trusted: whether the user vouches for the columns, so that suspicions only warn.
    """

    path: str = ""
    sha256: str = ""
    part: str = ""
    mapping: str = ""
    ignored: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unusable: Mapping[str, str] = field(default_factory=dict)
    holes: Mapping[str, str] = field(default_factory=dict)
    trusted: bool = False

    @property
    def label(self) -> str:
        """How messages call the log: its path, and the part of the file if there are several."""
        path = self.path or "log in memory"
        return f"{path}#{self.part}" if self.part else path


def short_label(label: str) -> str:
    """Return the name of a log, see `LogSource.label`, without its folders."""
    path, mark, part = label.partition("#")
    return "+".join(Path(file).name for file in path.split("+")) + mark + part


OF_THE_DRIVE = ("position_gain", "velocity_gain", "duty_gain", "supply_voltage", "torque_limit")


@dataclass(frozen=True, eq=False)
class Machine:
    """The drives and loads of one log.

    Attributes:
        transmission: of the robot, with this log's numbers of the drives.
        inertia: (10 n_links,) what its links have more than the robot's, in pinocchio's dynamic
            parameters: a payload.
    """

    transmission: Transmission
    inertia: FloatArray

    def of(self, robot: Robot) -> Robot:
        """Return the robot with these drives and loads."""
        drives = {name: getattr(self.transmission, name) for name in OF_THE_DRIVE}
        own, make = robot.model.inertias, pin.Inertia.FromDynamicParameters
        more = enumerate(self.inertia.reshape(-1, 10), start=1)
        links = {k: make(own[k].toDynamicParameters() + x) for k, x in more}
        gears = robot.transmission.replace(**drives)
        return robot.with_inertias(links).with_transmission(gears)


@dataclass(frozen=True, eq=False, repr=False)
class Log(Remade):
    """Channels of one run over one clock; their names are those of `wbc.measurement.schema`.

    Attributes:
        time: (N,) [s], finite and strictly increasing, N >= 2.
        columns: name -> (N,) values in SI units, joint side unless the name says otherwise;
            finite and read-only.
        source: where the log came from.
        machine: how its machine differs from the robot that it is held against, None if in nothing.
    """

    time: FloatArray
    columns: Mapping[str, FloatArray]
    source: LogSource = field(default_factory=LogSource)
    machine: Machine | None = None

    def __repr__(self) -> str:
        """Return what the log holds in a line or two: its name, size and columns."""
        size = f"{self.time.size} rows in {self.duration:.4g} s"
        return f"Log({self.source.label}: {size}; {few(self.names, _NAMED)})"

    def __post_init__(self) -> None:
        """Check every channel and make it read-only.

        Raises:
            LogError: fewer than two rows, time that does not increase, a channel of another
                length, a value that is no finite number, or a name that is not in the schema.
        """
        label = self.source.label
        time = _checked_series(self.time, schema.TIME, None, label)
        if time.size < 2:
            raise LogError(f"{label}: {time.size} rows; a log needs at least two.")
        advancing(time, {}, "error", np.arange(time.size), label)  # raises where it does not
        columns: dict[str, FloatArray] = {}
        for name, values in self.columns.items():
            if name == schema.TIME or not schema.is_column(name):
                raise LogError(f"{label}: " + schema.not_a_column(name))
            columns[schema.today(name)] = _checked_series(values, name, time.size, label)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))

    @classmethod
    def from_frame(cls, frame: Any) -> Log:
        """Return the log of a table in memory: a pandas or polars frame, or any mapping of columns.

        Args:
            frame: columns by name; those that are no column of a log are passed over.

        Raises:
            LogError: no table, no column `time`, or columns that make no log (see `Log`).
        """
        held = frame.keys() if hasattr(frame, "keys") else getattr(frame, "columns", None)
        if held is None:
            takes = "a pandas or polars frame, or a dictionary of columns by name"
            way = f"not {type(frame).__name__}; files are read with load_logs([...])."
            raise LogError(f"Log.from_frame takes {takes}, {way}")
        names = [str(name) for name in held]
        require_known(LogError, "column", schema.TIME, names, "log in memory")
        columns = {name: np.asarray(frame[name]) for name in names if schema.is_column(name)}
        ignored = tuple(name for name in names if name not in columns)
        return cls(columns.pop(schema.TIME), columns, LogSource(ignored=ignored))

    def __len__(self) -> int:
        """N, the number of rows."""
        return int(self.time.size)

    def __getitem__(self, rows: slice) -> Log:
        """Return the rows of a slice as a log (no copy).

        Raises:
            LogError: not a slice, or fewer than two rows left.
        """
        if not isinstance(rows, slice):
            raise LogError("a log is indexed by a slice of rows; use column(name) for a channel.")
        columns = {name: values[rows] for name, values in self.columns.items()}
        return replace(self, time=self.time[rows], columns=columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all channels, `time` excepted."""
        return tuple(self.columns)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that have any channel, in order of appearance."""
        return schema.owners(self.columns, schema.JOINT_QUANTITIES)

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the contacts that have a force channel, in order of appearance."""
        return schema.owners(self.columns, schema.FORCE_QUANTITIES)

    @property
    def duration(self) -> float:
        """Last minus first time stamp [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def sample_time(self) -> float:
        """Median distance of the time stamps [s]."""
        return float(np.median(np.diff(self.time)))

    def has(self, *names: str) -> bool:
        """Whether all of these channels are there."""
        return all(name == schema.TIME or schema.today(name) in self.columns for name in names)

    def recorded(self, name: str) -> bool:
        """Whether the log was recorded with this channel, be it usable or not."""
        return self.has(name) or name in self.source.unusable

    def with_quantity(self, quantity: str) -> tuple[str, ...]:
        """Return the joints that have a channel of this quantity."""
        return schema.owners(self.columns, [schema.today(f".{quantity}")[1:]])

    def column(self, name: str) -> FloatArray:
        """Return one channel, (N,), read-only.

        Raises:
            LogError: no such channel; the message lists those there are, and those of the file
                that were not read.
        """
        if name == schema.TIME:
            return self.time
        if (held := self.columns.get(schema.today(name))) is not None:
            return held
        if name in self.source.unusable:
            raise LogError(f"{self.source.label}: {self.source.unusable[name]}")
        message = f"{self.source.label}: " + unknown_name("column", name, self.names)
        raise LogError(f"{message} {unread(self.source.ignored, [name])[0]}".rstrip())

    def stack(self, quantity: str, owner_names: Sequence[str] | None = None) -> FloatArray:
        """Return one quantity of several joints (or contacts) as columns, (N, n).

        Args:
            quantity: for example `position` or `force.z`.
            owner_names: joints or contacts, in the order wanted; default all that have it.

        Raises:
            LogError: one of them lacks the channel.
        """
        chosen = self.with_quantity(quantity) if owner_names is None else owner_names
        columns = [self.column(f"{owner}.{quantity}") for owner in chosen]
        stacked = np.column_stack(columns) if columns else np.empty((len(self), 0))
        stacked.setflags(write=False)
        return stacked

    def between(self, start: float, stop: float) -> Log:
        """Return the rows with start <= time < stop [s], on the log's own clock.

        Raises:
            LogError: fewer than two rows lie there.
        """
        first, last = map(int, np.searchsorted(self.time, [start, stop]))
        if last - first < 2:
            ends = f"the log runs from {self.time[0]:g} s to {self.time[-1]:g} s"
            lacks = f"fewer than two rows between {start:g} s and {stop:g} s"
            raise LogError(f"{self.source.label}: {lacks}; {ends}.")
        return self[first:last]

    def select(self, names: Iterable[str]) -> Log:
        """Return a log with only these channels.

        Raises:
            LogError: one of them is not there.
        """
        return replace(self, columns={name: self.column(name) for name in names})

    def with_columns(self, columns: Mapping[str, ArrayLike]) -> Log:
        """Return a log with channels added or replaced."""
        added = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items()}
        return replace(self, columns={**self.columns, **added})


def _checked_series(values: ArrayLike, name: str, rows: int | None, label: str) -> FloatArray:
    """Return a read-only float channel (N,) after checking length and finiteness.

    An array that nobody can write to is kept as it is, any other is copied.

    Raises:
        LogError: text or objects instead of numbers, another length, NaN or infinity.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise LogError(f"{label}: column '{name}' holds {array.dtype} instead of numbers.")
    if array.ndim != 1:
        raise LogError(f"{label}: column '{name}' has shape {array.shape}, expected one axis.")
    if rows is not None and array.size != rows:
        raise LogError(f"{label}: column '{name}' has {array.size} rows, time has {rows}.")
    series = array if _unwritable(array) else frozen(array)
    if not np.isfinite(series).all():
        raise LogError(f"{label}: {hole(name, series, 'drop_rows')}")
    return series


def hole(name: str, values: FloatArray, missing: str) -> str:
    """Return that a column cannot be used, and how it can: by what a map says of `missing`."""
    bad = np.flatnonzero(~np.isfinite(values))
    what = "drop these rows" if missing == "drop_rows" else "lay straight lines over them"
    where = f"at row {int(bad[0])} ({bad.size} such rows of {values.size})"
    way = say_so({"columns": {name: {"missing": missing}}}, what)
    return f"column '{name}' holds {values[bad[0]]} {where}. Repair the file, or {way}"


def _unwritable(array: NDArray[Any]) -> bool:
    """Whether an array and everything it is a view of are read-only float64."""
    owned = array.base is None or (isinstance(array.base, np.ndarray) and _unwritable(array.base))
    return array.dtype == np.float64 and not array.flags.writeable and owned


@dataclass(frozen=True)
class LogFinding:
    """What is odd about a channel, and what to do about it.

    Attributes:
        severity: `error` makes results wrong, `warning` makes them worse, `info` is good to know.
        kind: short name for machines, such as `clock_lag`.
        column: the channel, `time`, or empty for the whole log.
        text: what was seen, with numbers.
        way_out: what to do.
        mend: what a column map says so that the log is right; empty where no map can.
        probability: that it is so.
        guess: what a map would say of the likeliest of several causes that the logs cannot tell
            apart. Nothing writes it: people choose.
        alone: whether only some of the logs that were given together have it.
    """

    severity: str
    kind: str
    column: str
    text: str
    way_out: str
    mend: Mend = field(default_factory=dict)
    probability: float = 1.0
    guess: Mend = field(default_factory=dict)
    alone: bool = False

    @property
    def likeliest(self) -> Mend:
        """What a map says if the likeliest cause is the true one."""
        return self.mend or self.guess

    @property
    def said(self) -> str:
        """Where it is, what was seen, and what to do."""
        return f"{f'{self.column}: ' if self.column else ''}{self.text} {self.way_out}"

    def __str__(self) -> str:
        """Return one line for people."""
        return f"{self.severity}: {self.said}"


LIKELY = 0.9
"""Probability from which a mistake is worth a warning."""
CERTAIN = 0.99
"""Probability from which a mistake stops a diagnosis."""


def severity(probability: float) -> str:
    """Return how severe a mistake is that has a probability."""
    return "error" if probability >= CERTAIN else "warning"


def listed(texts: Sequence[str]) -> str:
    """Return 'a, b and c', or 'a' where all texts are the same."""
    return joined(texts if len(set(texts)) > 1 else texts[:1])


CUT_FROM = 0.02
"""Logs are cut at gaps longer than this [s]: a straight line bridges shorter ones well enough."""

_LEAST_DURATION, _SHORTEST = 1.0, 0.5  # [s] of a piece, of a log


def cut_at_gaps(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs cut where samples are missing, and a warning for each log that was cut.

    A piece is a log of its own, `FILE#START..STOP s`; pieces too short to say anything are left
    out. Logs without gaps are returned as they are.

    Raises:
        LogError: less than half of the rows of a log are left in pieces that are long enough.
    """
    whole, warnings = [], []
    for log in logs:
        cuts = _cuts(log)
        if not cuts.size:
            whole.append(log)
            continue
        widths, at = log.time[cuts + 1] - log.time[cuts], log.time[cuts[0]]
        places = f"in {cuts.size} places, at most for {widths.max():.3g} s, first "
        places = places if cuts.size > 1 else ""
        where = f"samples are missing {places}for {widths[0]:.3g} s at {at:.3f} s"
        long = [piece for piece in _pieces(log, cuts) if piece.duration >= _LEAST_DURATION]
        kept = sum(map(len, long))
        if kept < 0.5 * len(log):
            left = f"only {kept} of {len(log)} rows are left in pieces long enough to be used"
            way = "Record with the drive's own clock, without losses."
            raise LogError(f"{log.source.label}: {where}, and {left}. {way}")
        spans = [f"{piece.time[0]:.3f}..{piece.time[-1]:.3f} s" for piece in long]
        for piece, span in zip(long, spans, strict=True):
            part = f"{log.source.part} {span}".lstrip()
            whole.append(replace(piece, source=replace(log.source, part=part)))
        used = f"The log is cut there; used are {', '.join(spans)}."
        way = "Runs cut in different places are not seen to repeat one another."
        warnings.append(f"{log.source.label}: {where}. {used} {way}")
    return whole, warnings


def longest_piece(log: Log) -> Log:
    """Return the longest part of a log in which no samples are missing."""
    return max(_pieces(log, _cuts(log)), key=len, default=log[:2])


def _cuts(log: Log) -> IntArray:
    """Return the rows (n,) after which a log is cut."""
    rows = gaps(log.time)
    return rows[log.time[rows + 1] - log.time[rows] > CUT_FROM]


def _pieces(log: Log, cuts: IntArray) -> list[Log]:
    parts = pairwise([0, *(cuts + 1).tolist(), len(log)])
    return [log[start:stop] for start, stop in parts if stop - start >= LEAST_ROWS]


def too_short(log: Log) -> LogFinding | None:
    """Return that a log is too short to say anything, None for a longer one."""
    if log.duration >= _SHORTEST and len(log) >= LEAST_ROWS:
        return None
    text = f"{log.duration:.2g} s with {len(log)} rows are too short to say anything."
    return LogFinding("error", "short", "", text, "Record at least a few seconds of motion.")
