"""Logs: schema, readers and writers, column maps, differentiation."""

from wbc.measurement.clocks import cut_at_gaps
from wbc.measurement.column_map import merged, parse_column_map, read_table, together
from wbc.measurement.filters import align_velocity, derivative, differentiate, low_pass
from wbc.measurement.findings import LogFinding, write_map
from wbc.measurement.formats import save_log
from wbc.measurement.log import Log, LogSource, Machine
from wbc.measurement.read import load_log, load_logs, mended

__all__ = [
    "Log",
    "LogFinding",
    "LogSource",
    "Machine",
    "align_velocity",
    "cut_at_gaps",
    "derivative",
    "differentiate",
    "load_log",
    "load_logs",
    "low_pass",
    "mended",
    "merged",
    "parse_column_map",
    "read_table",
    "save_log",
    "together",
    "write_map",
]
