"""A column map applied to a log that is read already."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.measurement.columns.column_map import ColumnMap, parse_column_map
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.log import Log
from wbc.measurement.motion.align import align_velocity
from wbc.measurement.schema import TIME


def mended(log: Log, mend: Mend, gear_ratios: Mapping[str, float] | None = None) -> Log:
    """Return a log changed as a column map says whose sources are its own columns.

    Args:
        log: as it was read.
        mend: a parsed column map, without [rows].
        gear_ratios: N of joints, for entries that name a side of the gear and no ratio.

    Raises:
        LogError: an entry that does not fit, or a column that the log does not have.
    """
    return _applied(log, parse_column_map(mend, "", gear_ratios))


def _applied(log: Log, rules: ColumnMap) -> Log:
    used = {source for rule in rules.rules for source in rule.sources} | set(rules.left_out)
    targets = {rule.target for rule in rules.rules}
    columns: dict[str, FloatArray] = {
        name: values for name, values in log.columns.items() if name not in used | targets
    }
    for rule in rules.rules:
        sources = {name: log.column(name) for name in rule.sources}
        if rule.unwrap > 0.0:
            sources = {n: np.unwrap(values, period=rule.unwrap) for n, values in sources.items()}
        columns[rule.target] = rule.value(sources)
    clock = rules.time
    time = log.time if clock.source != TIME else clock.factor * log.time + clock.offset
    changed = replace(log, time=time, columns=columns)
    return align_velocity(changed) if clock.align_velocity else changed
