"""Recorded runs that come with the package: something to try on before there are logs of one's own.

Three simulated runs of the robot `planar_leg_fixed` (5 s at 500 Hz, noise of encoders and torque
sensors included); the second one repeats the first. The leg behind them has a gear with losses at
the knee and dry friction at the hip that `load_robot("planar_leg_fixed").lossless()` has not. They
are made by `wbc.sim.excitation.record_with`.
"""

from __future__ import annotations

from pathlib import Path

from wbc.measurement import Log, load_logs


def sample_paths() -> tuple[Path, ...]:
    """Return the files of the sample logs, as the command line takes them."""
    return tuple(sorted(Path(__file__).parent.glob("leg_run*.npz")))


def sample_logs() -> tuple[Log, ...]:
    """Return the sample logs."""
    return load_logs(sample_paths())
