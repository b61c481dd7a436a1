"""Logs: schema, readers and writers, column maps, differentiation."""

from wbc.measurement.column_map import (
    merged as merged,
    parse_column_map as parse_column_map,
    read_table as read_table,
    together as together,
    write_map as write_map,
)
from wbc.measurement.filters import (
    align_velocity as align_velocity,
    derivative as derivative,
    differentiate as differentiate,
    low_pass as low_pass,
)
from wbc.measurement.formats import save_log as save_log
from wbc.measurement.log import (
    Log as Log,
    LogFinding as LogFinding,
    LogSource as LogSource,
    Machine as Machine,
    cut_at_gaps as cut_at_gaps,
)
from wbc.measurement.read import load_log as load_log, load_logs as load_logs, mended as mended
