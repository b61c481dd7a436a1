"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.checks import check_log, check_logs
from wbc.measurement.clocks import cut_at_gaps, find_duplicates, find_repeats
from wbc.measurement.column_map import (
    ColumnMap,
    ColumnRule,
    RowChoice,
    TimeRule,
    parse_column_map,
    read_column_map,
)
from wbc.measurement.filters import (
    WINDOW_SAMPLES,
    VelocityFit,
    align_velocity,
    derivative,
    differentiate,
    fit_velocity,
    local_polynomial_operator,
    low_pass,
    residual_noise,
    unsmooth,
)
from wbc.measurement.findings import LogFinding, LogQuality
from wbc.measurement.log import Log, LogSource
from wbc.measurement.map_lines import in_degrees, merged, read_table, say_so, together, write_map
from wbc.measurement.mistakes import (
    SuspiciousLogError,
    find_suspicions,
    require_plausible_units,
    suspicions,
)
from wbc.measurement.read import MAX_ROWS, load_log, load_logs, mended, read_logs
from wbc.measurement.robot_checks import check_robot, unknown_base, unknown_joints
from wbc.measurement.tables import save_log
from wbc.measurement.torque import (
    Machine,
    feedback_torques,
    joint_position,
    loaded,
    makes_torque,
    placeless_joints,
    reports_current,
    reports_torque,
    rotor_torques,
    torque_quantity,
    with_machine,
    without_position,
)

__all__ = [
    "MAX_ROWS",
    "WINDOW_SAMPLES",
    "ColumnMap",
    "ColumnRule",
    "Log",
    "LogFinding",
    "LogQuality",
    "LogSource",
    "Machine",
    "RowChoice",
    "SuspiciousLogError",
    "TimeRule",
    "VelocityFit",
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
    "in_degrees",
    "joint_position",
    "load_log",
    "load_logs",
    "loaded",
    "local_polynomial_operator",
    "low_pass",
    "makes_torque",
    "mended",
    "merged",
    "parse_column_map",
    "placeless_joints",
    "read_column_map",
    "read_logs",
    "read_table",
    "reports_current",
    "reports_torque",
    "require_plausible_units",
    "residual_noise",
    "rotor_torques",
    "save_log",
    "say_so",
    "suspicions",
    "together",
    "torque_quantity",
    "unknown_base",
    "unknown_joints",
    "unsmooth",
    "with_machine",
    "without_position",
    "write_map",
]
