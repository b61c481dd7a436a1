"""Logs: schema, checks, readers and writers, differentiation, repeats."""

from wbc.measurement.align import align_velocity
from wbc.measurement.check import check_log, check_logs
from wbc.measurement.column_map import ColumnMap, parse_column_map, read_column_map
from wbc.measurement.column_rule import ColumnRule
from wbc.measurement.finding import Finding
from wbc.measurement.fused_motion import FusedMotion, fuse_motion
from wbc.measurement.gaps import cut_at_gaps
from wbc.measurement.load import MAX_ROWS, load_log, load_logs
from wbc.measurement.local_noise import residual_noise
from wbc.measurement.local_polynomial import local_polynomial_operator
from wbc.measurement.log import Log
from wbc.measurement.log_quality import LogQuality
from wbc.measurement.noise import noise_floor, repeat_deviation
from wbc.measurement.noise_floor import NoiseFloor
from wbc.measurement.repeats import find_duplicates, find_repeats
from wbc.measurement.row_choice import RowChoice
from wbc.measurement.save import save_log
from wbc.measurement.source import LogSource
from wbc.measurement.time_rule import TimeRule
from wbc.measurement.torque import rotor_torques, torque_quantity
from wbc.measurement.unit_check import require_plausible_units
from wbc.measurement.velocity_fit import VelocityFit, fit_velocity
from wbc.measurement.weak_form import WeakOperator, weak_operator
from wbc.measurement.zero_phase import Derivatives, filtered_derivatives, low_pass

__all__ = [
    "MAX_ROWS",
    "ColumnMap",
    "ColumnRule",
    "Derivatives",
    "Finding",
    "FusedMotion",
    "Log",
    "LogQuality",
    "LogSource",
    "NoiseFloor",
    "RowChoice",
    "TimeRule",
    "VelocityFit",
    "WeakOperator",
    "align_velocity",
    "check_log",
    "check_logs",
    "cut_at_gaps",
    "filtered_derivatives",
    "find_duplicates",
    "find_repeats",
    "fit_velocity",
    "fuse_motion",
    "load_log",
    "load_logs",
    "local_polynomial_operator",
    "low_pass",
    "noise_floor",
    "parse_column_map",
    "read_column_map",
    "repeat_deviation",
    "require_plausible_units",
    "residual_noise",
    "rotor_torques",
    "save_log",
    "torque_quantity",
    "weak_operator",
]
