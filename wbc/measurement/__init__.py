"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.checks.check import check_log, check_logs
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.log_quality import LogQuality
from wbc.measurement.columns.column_map import ColumnMap, parse_column_map, read_column_map
from wbc.measurement.columns.column_rule import ColumnRule
from wbc.measurement.columns.row_choice import RowChoice
from wbc.measurement.columns.time_rule import TimeRule
from wbc.measurement.formats.save import save_log
from wbc.measurement.gaps import cut_at_gaps
from wbc.measurement.load import MAX_ROWS, load_log, load_logs, read_logs
from wbc.measurement.log import Log
from wbc.measurement.machine import Machine, with_machine
from wbc.measurement.motion.align import align_velocity
from wbc.measurement.motion.local_noise import residual_noise
from wbc.measurement.motion.local_polynomial import local_polynomial_operator
from wbc.measurement.motion.velocity_fit import VelocityFit, fit_velocity
from wbc.measurement.motion.zero_phase import derivative, low_pass
from wbc.measurement.positions import joint_position, placeless_joints, without_position
from wbc.measurement.repeats import find_duplicates, find_repeats
from wbc.measurement.source import LogSource
from wbc.measurement.suspicions.find import (
    SuspiciousLogError,
    find_suspicions,
    require_plausible_units,
    suspicions,
)
from wbc.measurement.torque import (
    feedback_torques,
    makes_torque,
    reports_current,
    reports_torque,
    rotor_torques,
    torque_quantity,
)

__all__ = [
    "MAX_ROWS",
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
    "cut_at_gaps",
    "derivative",
    "feedback_torques",
    "find_duplicates",
    "find_repeats",
    "find_suspicions",
    "fit_velocity",
    "joint_position",
    "load_log",
    "load_logs",
    "local_polynomial_operator",
    "low_pass",
    "makes_torque",
    "parse_column_map",
    "placeless_joints",
    "read_column_map",
    "read_logs",
    "reports_current",
    "reports_torque",
    "require_plausible_units",
    "residual_noise",
    "rotor_torques",
    "save_log",
    "suspicions",
    "torque_quantity",
    "with_machine",
    "without_position",
]
