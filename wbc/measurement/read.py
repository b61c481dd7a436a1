"""Reading logs from files: the table of a file becomes the channels of one log or several."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import LogError, require_known, unknown_name
from wbc.measurement.clocks import GAP_STEPS, advancing, leaps, restarts
from wbc.measurement.column_map import (
    ColumnMap,
    ColumnRule,
    Mend,
    TimeRule,
    parse_column_map,
    read_table,
    say_so,
)
from wbc.measurement.filters import align_velocity, shifted
from wbc.measurement.formats import digest, open_table
from wbc.measurement.log import Log, LogSource, hole
from wbc.measurement.schema import LOG_UNITS, TIME, column_units, is_column, likely_meant, today
from wbc.measurement.tables import Table
from wbc.tables import few

_EFFORT = ".effort"
_MOST_DROPPED = 0.9  # of the rows of a file; where more lack something, no row is whole by chance
_SHOWN = 8  # combinations of values that a message lists


def load_log(
    path: str | Path,
    columns: str | Path | ColumnMap | None = None,
    gear_ratios: Mapping[str, float] | None = None,
) -> Log:
    """Read the one log of a file; the arguments are those of `load_logs`.

    Raises:
        LogError: also when the file holds several logs, which the message lists, or none of its
            columns can be used.
    """
    logs = load_logs([path], columns, gear_ratios)
    if len(logs) != 1:
        way = f"choose one as '{path}#NAME', or read them all with load_logs"
        parts = ", ".join(log.source.part for log in logs)
        raise LogError(f"'{path}' holds {len(logs)} logs; {way}. There are: {parts}.")
    if not logs[0].columns:
        why = [*logs[0].source.unusable.values(), "every column is empty."]
        raise LogError(f"{logs[0].source.label}: {why[0]}")
    return logs[0]


def load_logs(
    paths: Iterable[str | Path],
    columns: str | Path | ColumnMap | None = None,
    gear_ratios: Mapping[str, float] | None = None,
) -> tuple[Log, ...]:
    """Read logs from text (CSV and its kin), Parquet, NPZ, MCAP and rosbag2 files.

    Args:
        paths: files. `FILE#PATTERN` picks logs by name (`*` and `?` allowed) from a file that holds
            several: a column map splits it, or its clock starts again (`#run1`, `#run2`).
            `FILE+FILE` are columns of one run, put side by side by their clocks.
        columns: column map for foreign names and units, or its path; None for a file that has our
            names (`effort` is read as motor_torque).
        gear_ratios: N of joints, for a map that names a side of the gear but no ratio.

    Returns:
        The logs in order of files, and of first appearance within a file.

    Raises:
        LogError: a file, map or log that cannot be used; the message says which and why.
    """
    if isinstance(columns, str | Path):
        columns = parse_column_map(read_table(columns), str(columns), gear_ratios)
    rules = columns or ColumnMap(())
    return tuple(log for path in paths for log in _load(path, rules))


def split_path(path: str | Path) -> tuple[Path, str]:
    """Return (file, pattern of log names) of `FILE#PATTERN`."""
    file, mark, pattern = str(path).rpartition("#")
    if not mark or Path(path).exists():
        return Path(path), ""
    return Path(file), pattern


def mended(log: Log, mend: Mend, gear_ratios: Mapping[str, float] | None = None) -> Log:
    """Return a log changed as a column map says whose sources are its own columns.

    Args:
        log: as it was read.
        mend: a parsed column map, without [rows].
        gear_ratios: N of joints, for entries that name a side of the gear and no ratio.

    Raises:
        LogError: an entry that does not fit, or a column that the log does not have.
    """
    if not mend:
        return log
    table = Table(Path(log.source.label), {TIME: log.time, **log.columns})
    rules, _, _ = _patched(parse_column_map(mend, "", gear_ratios), table)
    time = clock_of(table, rules.time)
    made = _log(table, rules, np.arange(len(log)), time, log.source)
    return replace(log, time=made.time, columns=made.columns)


def clock_of(table: Table, rule: TimeRule) -> FloatArray:
    """Return the time stamps (N,) [s] that a map finds in a table."""
    if rule.rate > 0.0:
        return np.arange(table.rows) / rule.rate + rule.offset
    kind, stated = LOG_UNITS.get(table.units.get(rule.source, ""), ("", 1.0))
    factor = stated if kind == "s" and rule.factor == 1.0 else rule.factor
    return factor * table.numbers(rule.source) + rule.offset


def _load(path: str | Path, columns: ColumnMap) -> list[Log]:
    file, pattern = split_path(path)
    table = open_table(file, columns.rows)
    rules, ignored, notes = _patched(columns, table)
    notes, trusted = (*table.notes, *notes), rules.trusted
    source = LogSource(str(file), digest(file), "", rules.path, ignored, notes, trusted=trusted)
    time = clock_of(table, rules.time)
    return [
        _log(table, rules, rows, time[rows], replace(source, part=part))
        for part, rows in _parts(table, rules, time, pattern).items()
    ]


def _log(
    table: Table, rules: ColumnMap, rows: IntArray, time: FloatArray, source: LogSource
) -> Log:
    """Return the log of some rows of a table.

    Raises:
        LogError: nothing is left, or what is left is no log (see `Log`).
    """
    block, (first, last) = dict[str, FloatArray](), rules.rows.between
    kept = (time >= first) & (time <= last)
    for rule in rules.rules:
        values = rule.value({name: table.numbers(name)[rows] for name in rule.sources})
        known = np.isfinite(values)
        if rule.missing == "bridge" and known.any():  # but for the ends
            values = np.interp(time, time[known], values[known], left=np.nan, right=np.nan)
        kept &= ~np.isnan(values) | (rule.missing == "when_needed")
        block[rule.target] = values
    if not kept.any():
        raise LogError(f"{source.label}: no rows ({rows.size} read, {rows.size} dropped).")
    block = {name: column[kept] for name, column in block.items()}
    time, apart = advancing(time[kept], block, rules.time.repeated, rows[kept], source.label)
    block = {name: column[apart] for name, column in block.items()}
    empty = {name for name, column in block.items() if np.isnan(column).all()}
    columns = {name: column for name, column in block.items() if np.isfinite(column).all()}
    unusable = {n: column for n, column in block.items() if n not in columns and n not in empty}
    void = {rule.target: ", ".join(rule.sources) for rule in rules.rules if rule.target in empty}
    notes = [f"{target} left out: {sources} is empty." for target, sources in void.items()]
    if dropped := rows.size - np.count_nonzero(apart):
        notes.append(f"{dropped} of {rows.size} rows dropped by the column map.")
    holes = _holes(unusable)
    told = {name: hole(name, column, holes[name]) for name, column in unusable.items()}
    source = replace(source, notes=(*source.notes, *notes), unusable=told, holes=holes)
    lags = {rule.target: rule.lag for rule in rules.rules if rule.lag and rule.target in columns}
    log = shifted(Log(time, columns, source), lags)
    return align_velocity(log) if rules.time.align_velocity else log


def _holes(unusable: Mapping[str, FloatArray]) -> dict[str, str]:
    """Return what a map says of channels with holes, so that all of them can be used.

    Rows with holes are dropped. Where few rows would be left, channels came at times of their own:
    the rows of the first position stay, and those of other times are bridged.
    """
    lacking = {name: ~np.isfinite(values) for name, values in unusable.items()}
    if not lacking or np.mean(np.any(list(lacking.values()), axis=0)) < _MOST_DROPPED:
        return dict.fromkeys(lacking, "drop_rows")
    first = lacking[next((n for n in lacking if n.endswith(".position")), next(iter(lacking)))]
    return {n: "drop_rows" if (own == first).all() else "bridge" for n, own in lacking.items()}


def _parts(table: Table, rules: ColumnMap, time: FloatArray, pattern: str) -> dict[str, IntArray]:
    """Return the rows of every log that a file holds and that is wanted, by the log's name.

    A log is what a value of the splitting column marks without a break: where the value comes back
    after a gap of the clock, the clock starts again, or joints leap, another log begins. Logs whose
    rows alternate on one clock are no break.

    Raises:
        LogError: nothing fits; the message lists the logs that there are.
    """
    if not table.rows:
        raise LogError(f"'{table.path}' is empty: it has columns but no rows.")
    choice = rules.rows
    keys = {name: table.texts(name) for name in choice.keys}
    rows = np.flatnonzero(choice.keeps(keys, table.rows))
    found: dict[str, IntArray] = {}
    values = keys[choice.split][rows] if choice.split else np.full(rows.size, "")
    places = [rule for rule in rules.rules if rule.target.endswith(".position")]
    positions = [rule.value({n: table.numbers(n) for n in rule.sources}) for rule in places]
    for value in dict.fromkeys(values.tolist()):
        own = rows[values == value]
        again = leaps(time[own], [column[own] for column in positions])
        pieces = np.split(own, np.union1d(_breaks(own, time[own]), again))
        for k, piece in enumerate(pieces, start=1):
            name = f"{value}/{k}" if value else f"run{k}"
            found[name if len(pieces) > 1 else value] = piece
    found = dict(sorted(found.items(), key=lambda part: part[1][0]))
    if pattern and list(found) == [""]:
        way = f"Leave '#{pattern}' out: no column has values that it names."
        for name in table.names:
            if any(fnmatchcase(value, pattern) for value in np.unique(table.texts(name))):
                way = f"Its column '{name}' has such values; " + say_so({"rows": {"split": name}})
        raise LogError(f"{table.path}: '#{pattern}' names one, but nothing splits the file. {way}")
    wanted = {p: own for p, own in found.items() if not pattern or fnmatchcase(p, pattern)}
    if not wanted:
        where = "".join(f" where {column} = {value}" for column, value in choice.where.items())
        cells = zip(*(keys[name].tolist() for name in choice.where), strict=True)
        held = few([*(found or dict.fromkeys(" with ".join(row) for row in cells))], _SHOWN)
        raise LogError(f"{table.path}: no log '{pattern or '*'}'{where}. There are: {held}.")
    return wanted


def _breaks(rows: IntArray, time: FloatArray) -> IntArray:
    """Return the places within the rows of one value at which a new log begins."""
    steps, interrupted = np.diff(time), np.diff(rows) > 1
    usual = float(np.nanmedian(steps)) if interrupted.any() else np.inf
    apart = interrupted & ~((steps > 0.0) & (steps <= GAP_STEPS * usual))
    return np.union1d(np.flatnonzero(apart) + 1, restarts(time)).astype(np.int_)


def _patched(rules: ColumnMap, table: Table) -> tuple[ColumnMap, tuple[str, ...], tuple[str, ...]]:
    """Return the map that reads a file: the columns with our names, changed as a map says.

    Args:
        rules: a map; one without entries changes nothing.
        table: the file.

    Returns:
        The map with an entry for every channel, the columns that it passes over, and notes on what
        was taken for granted.

    Raises:
        LogError: no clock, no channel, a name that looks misspelt, or a column that the file lacks.
    """
    own, notes = _own_rules(table)
    # A rule that names no source means the column that its channel has in this file.
    stated = [
        replace(rule, sources=own.get(rule.target, rule).sources)
        if rule.sources == (rule.target,)
        else rule
        for rule in rules.rules
    ]
    used = {source for rule in stated for source in rule.sources} | set(rules.rows.keys)
    _require_spelling(table, rules, used)
    taken = {rule.target for rule in stated} | set(map(today, rules.left_out)) | {rules.time.source}
    free = [r for target, r in own.items() if target not in taken and not used & set(r.sources)]
    complete = replace(rules, rules=(*free, *stated))
    _require_columns(complete, table)
    read = {s for rule in complete.rules for s in rule.sources} | {rules.time.source, *used}
    ignored = tuple(n for n in table.names if n not in read and n not in rules.left_out)
    guessed = {rule.target for rule in free}
    return complete, ignored, tuple(note for target, note in notes.items() if target in guessed)


def _own_rules(table: Table) -> tuple[dict[str, ColumnRule], dict[str, str]]:
    """Return the entries of the columns that need no map, by channel, and notes on some."""
    rules: dict[str, ColumnRule] = {}
    notes: dict[str, str] = {}
    for name in table.names:
        effort = f"{name.removesuffix(_EFFORT)}.motor_torque"
        if name != TIME and is_column(name):
            kind, factor = LOG_UNITS.get(table.units.get(name, ""), ("", 1.0))
            known = kind in (column_units(name) or ())
            rules[today(name)] = ColumnRule(today(name), (name,), (factor if known else 1.0,))
        elif name.endswith(_EFFORT) and is_column(effort) and effort not in table.names:
            rules[effort] = ColumnRule(effort, (name,), (1.0,))
            rotor = {"columns": {effort.replace("motor_", "rotor_"): {"from": name}}}
            notes[effort] = f"{name} is taken for {effort}. If it is the rotor's torque (or a "
            notes[effort] += f"current, with current in place of rotor_torque), {say_so(rotor)}"
    return rules, notes


def _require_spelling(table: Table, rules: ColumnMap, used: set[str]) -> None:
    """Raise where a column that nothing uses looks like one of ours misspelt."""
    given = {*table.names, *(rule.target for rule in rules.rules), *rules.left_out}
    given |= {TIME} if rules.time.source != TIME else set()
    for name in table.names:
        meant = likely_meant(name)
        if meant is None or meant in given or name in used | set(rules.left_out):
            continue
        source = {"from": name}
        way = say_so({"time": source} if meant == TIME else {"columns": {meant: source}})
        wrong = f"{table.path}: column '{name}' looks like '{meant}' misspelt"
        raise LogError(f"{wrong}; rename it, or {way}")


def _require_columns(rules: ColumnMap, table: Table) -> None:
    """Raise where a file lacks its clock, every channel, or a column that the map needs."""
    if rules.time.source == TIME and TIME not in table.names:
        clock, rate = say_so({"time": {"from": "CLOCK"}}), say_so({"time": {"rate": 100}})
        raise LogError(
            f"{table.path}: {unknown_name('column', TIME, table.names)} Put the name of the "
            f"clock's column in place of CLOCK, and {clock}\n"
            f"If the file has no clock, put its rate [Hz] in place of 100, and {rate}"
        )
    if not rules.rules:
        lacks = "none of its columns has a name of a log (<joint>.position, ...)"
        way = f"Let `wbc init MODEL {shlex.quote(str(table.path))}` write a first column map for "
        way += "the URDF, MJCF or robot MODEL."
        raise LogError(f"{table.path}: {lacks}. There are: {', '.join(table.names)}. {way}")
    needed = [(f"columns.{rule.target}", s) for rule in rules.rules for s in rule.sources]
    needed += [*(("rows", key) for key in rules.rows.keys), ("time", rules.time.source)]
    for key, name in (one for one in needed if one[1]):
        place = f"{rules.path or 'column map'}: {key}"
        require_known(LogError, f"column of '{table.path}'", name, table.names, place)
