"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.checks import check_log, check_logs
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
from wbc.measurement.mistakes import find_suspicions, suspicions
from wbc.measurement.read import load_log, load_logs, mended, read_logs
from wbc.measurement.robot_checks import check_robot, moving_contact, refusal
from wbc.measurement.torque import (
    feedback_torques,
    joint_position,
    makes_torque,
    reports_current,
    reports_torque,
    rotor_torques,
    with_machine,
    without_position,
)

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
    "check_log",
    "check_logs",
    "check_robot",
    "cut_at_gaps",
    "derivative",
    "differentiate",
    "feedback_torques",
    "find_duplicates",
    "find_repeats",
    "find_suspicions",
    "fit_velocity",
    "joint_position",
    "load_log",
    "load_logs",
    "loaded",
    "local_polynomial_operator",
    "low_pass",
    "makes_torque",
    "mended",
    "merged",
    "moving_contact",
    "parse_column_map",
    "read_column_map",
    "read_logs",
    "read_table",
    "refusal",
    "reports_current",
    "reports_torque",
    "residual_noise",
    "rotor_torques",
    "save_log",
    "suspicions",
    "together",
    "unsmooth",
    "with_machine",
    "without_position",
    "write_map",
]
