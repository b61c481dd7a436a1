"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.clocks import cut_at_gaps, find_duplicates, find_repeats
from wbc.measurement.column_map import (
    ColumnMap,
    parse_column_map,
    read_column_map,
)
from wbc.measurement.filters import (
    WINDOW_SAMPLES,
    align_velocity,
    derivative,
    differentiate,
    fit_velocity,
    local_polynomial_operator,
    low_pass,
    residual_noise,
    unsmooth,
)
from wbc.measurement.findings import (
    LogFinding,
    LogQuality,
    SuspiciousLogError,
    merged,
    read_table,
    together,
    write_map,
)
from wbc.measurement.formats import save_log
from wbc.measurement.log import Log, LogSource, Machine, loaded
from wbc.measurement.read import load_log, load_logs, mended, read_logs

__all__ = [
    "WINDOW_SAMPLES",
    "ColumnMap",
    "Log",
    "LogFinding",
    "LogQuality",
    "LogSource",
    "Machine",
    "SuspiciousLogError",
    "align_velocity",
    "cut_at_gaps",
    "derivative",
    "differentiate",
    "find_duplicates",
    "find_repeats",
    "fit_velocity",
    "load_log",
    "load_logs",
    "loaded",
    "local_polynomial_operator",
    "low_pass",
    "mended",
    "merged",
    "parse_column_map",
    "read_column_map",
    "read_logs",
    "read_table",
    "residual_noise",
    "save_log",
    "together",
    "unsmooth",
    "write_map",
]
