"""Turning the rows of one log, as they arrive from a file, into the channels of a `Log`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import LogError
from wbc.measurement.columns.column_map import ColumnMap
from wbc.measurement.columns.column_rule import ColumnRule
from wbc.measurement.columns.decimator import Decimator
from wbc.measurement.columns.mend import say_so
from wbc.measurement.log import Log
from wbc.measurement.motion.align import align_velocity
from wbc.measurement.source import LogSource


class Intake:
    """Collects one log: applies the rules of a map, chooses rows, decimates."""

    def __init__(self, rules: ColumnMap, factor: int, source: LogSource) -> None:
        """Start with no rows.

        Args:
            rules: what to make of the foreign columns; all sources must be in the file.
            factor: every how many rows one is kept.
            source: provenance of the log to come.
        """
        self._map = rules
        self._source = source
        self._decimator = Decimator(factor)
        self._blocks: list[FloatArray] = []
        self._seen = 0
        self._dropped = 0
        self._last_time = -np.inf
        self._wrapped: dict[str, tuple[float, float]] = {}

    def push(self, numbers: Mapping[str, FloatArray], count: int) -> None:
        """Take the next `count` rows of the foreign columns.

        Raises:
            LogError: the time goes back, or repeats where the map does not allow it.
        """
        time = self._time(numbers, count)
        rows = [time, *(rule.value(self._unwrapped(rule, numbers)) for rule in self._map.rules)]
        block = np.stack(rows, axis=1)
        first, last = self._map.rows.between
        kept = (time >= first) & (time <= last)
        for k, rule in enumerate(self._map.rules, start=1):
            if rule.missing == "drop_rows":
                kept &= ~np.isnan(block[:, k])
        kept &= self._advancing(time, kept)
        self._seen += count
        self._dropped += count - int(np.count_nonzero(kept))
        if kept.any():
            self._last_time = float(time[kept][-1])
            self._keep(self._decimator.push(block if kept.all() else block[kept]))

    def finish(self) -> Log:
        """Return the log.

        Raises:
            LogError: nothing is left, or what is left is no log (see `Log`).
        """
        self._keep(self._decimator.finish())
        label = self._source.label
        if not self._blocks:
            raise LogError(f"{label}: no rows ({self._seen} read, {self._dropped} dropped).")
        # One channel at a time, so that the whole never stands in memory twice.
        notes = list(self._source.notes)
        time = self._channel(0)
        columns: dict[str, FloatArray] = {}
        unusable: dict[str, str] = {}
        for k, rule in enumerate(self._map.rules, start=1):
            values = self._channel(k)
            if rule.missing == "omit" and np.isnan(values).all():
                notes.append(f"{rule.target} left out: {', '.join(rule.sources)} is empty.")
            elif rule.missing == "when_needed" and not np.isfinite(values).all():
                unusable[rule.target] = _holes(rule.target, values)
            else:
                columns[rule.target] = values
        if unusable and not columns:
            raise LogError(f"{label}: " + next(iter(unusable.values())))
        if self._dropped:
            notes.append(f"{self._dropped} of {self._seen} rows dropped by the column map.")
        source = replace(
            self._source,
            decimation=self._decimator.factor,
            notes=tuple(notes),
            unusable=unusable,
        )
        log = Log(time, columns, source)
        return align_velocity(log) if self._map.time.align_velocity else log

    def _keep(self, rows: FloatArray) -> None:
        if rows.size:
            self._blocks.append(np.asfortranarray(rows))

    def _channel(self, index: int) -> FloatArray:
        values = np.concatenate([block[:, index] for block in self._blocks])
        values.setflags(write=False)
        return values

    def _time(self, numbers: Mapping[str, FloatArray], count: int) -> FloatArray:
        rule = self._map.time
        if rule.rate > 0.0:
            return np.asarray((self._seen + np.arange(count)) / rule.rate + rule.offset)
        return np.asarray(rule.factor * numbers[rule.source] + rule.offset)

    def _advancing(self, time: FloatArray, kept: BoolArray) -> BoolArray:
        """Return which rows to keep so that time increases, or raise where it must already."""
        index = np.flatnonzero(kept)
        steps = np.diff(time[index], prepend=self._last_time)
        bad = np.flatnonzero(~(steps > 0.0))
        repeats = np.zeros(time.size, dtype=bool)
        if not bad.size:
            return ~repeats
        if (
            self._map.time.repeated == "first"
            and not np.any(steps < 0.0)
            and not np.isnan(steps).any()
        ):
            repeats[index[bad]] = True
            return ~repeats
        place, fault = int(index[bad[0]]), _fault(float(steps[bad[0]]))
        raise LogError(
            f"{self._source.label}: time {fault} at row {self._seen + place} "
            f"({time[place]:.9g} s). Sort the file"
            + (
                f", or {say_so({'time': {'repeated': 'first'}}, 'keep the first of such rows')}"
                if steps[bad[0]] == 0.0
                else "."
            )
        )

    def _unwrapped(
        self, rule: ColumnRule, numbers: Mapping[str, FloatArray]
    ) -> Mapping[str, FloatArray]:
        """Return the sources of a rule, made continuous across pieces if the rule says so."""
        if rule.unwrap <= 0.0:
            return numbers
        result: dict[str, FloatArray] = {}
        for name in rule.sources:
            raw = numbers[name]
            before = self._wrapped.get(name, (float(raw[0]), float(raw[0])))
            joined = np.unwrap(np.concatenate([[before[0]], raw]), period=rule.unwrap)
            result[name] = joined[1:] + (before[1] - before[0])
            self._wrapped[name] = (float(raw[-1]), float(result[name][-1]))
        return result


def _fault(step: float) -> str:
    if np.isnan(step):
        return "is NaN"
    return "repeats" if step == 0.0 else "goes back"


def _holes(target: str, values: FloatArray) -> str:
    """Return the message for a channel that cannot be used, and how it can."""
    bad = np.flatnonzero(~np.isfinite(values))
    drop = say_so({"columns": {target: {"missing": "drop_rows"}}}, "drop these rows")
    return (
        f"column '{target}' holds {values[bad[0]]} at row {int(bad[0])} ({bad.size} such rows of "
        f"{values.size}). Repair the file, or {drop}"
    )
