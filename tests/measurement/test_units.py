"""Units as people write them: in a map, in a line below the header, in the name of a column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc.measurement import load_log
from wbc.measurement.names import guess_name


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("mNm", 1e-3), ("N mm", 1e-3), ("Nmm", 1e-3), ("N*mm", 1e-3), ("Ncm", 1e-2), ("Nm", 1.0)],
)
def test_a_torque_in_any_spelling_of_its_unit(unit: str, factor: float, tmp_path: Path) -> None:
    """A line of units below the header named Nmm, and the torque was taken for N m."""
    path, fix = tmp_path / "run.csv", tmp_path / "map.toml"
    path.write_text("time,hip.rotor_torque\n0,100\n0.1,200\n")
    fix.write_text(f'columns."hip.rotor_torque" = {{ unit = "{unit}" }}\n')
    mapped = load_log(path, fix).column("hip.rotor_torque")
    np.testing.assert_allclose(mapped, [100.0 * factor, 200.0 * factor])
    path.write_text(f"time,hip.rotor_torque\n[s],[{unit}]\n0,100\n0.1,200\n")
    np.testing.assert_allclose(load_log(path).column("hip.rotor_torque"), mapped)
    path.write_text(f"time,hip.rotor_torque\n[ms],[{unit}]\n0,100\n100,200\n")
    np.testing.assert_allclose(load_log(path).time, [0.0, 0.1])


@pytest.mark.parametrize(
    ("name", "quantity", "unit", "owner"),
    [
        ("hip_torque_mNm", "motor_torque", "mN m", "hip"),
        ("hip_torque [N mm]", "motor_torque", "N mm", "hip"),
        ("tau1_Nmm", "motor_torque", "N mm", "1"),
        ("hipTorqueMNm", "motor_torque", "mN m", "hip"),
        ("hip_current_mA", "current", "mA", "hip"),
        ("hip_vel_mm/s", "velocity", "mm/s", "hip"),
        ("hip_v", "velocity", "", "hip"),
        ("hip_temp [deg C]", "temperature", "deg C", "hip"),
        ("q_1", "position", "", "1"),
    ],
)
def test_the_unit_in_a_name_is_read_whole(name: str, quantity: str, unit: str, owner: str) -> None:
    """The m of mNm and mA went to the joint's name, and the torque was a thousand times too large.

    `wbc init` wrote a map that read mN m as N m.
    """
    found = guess_name(name)
    assert (found.quantity, found.unit, found.owner) == (quantity, unit, owner)
