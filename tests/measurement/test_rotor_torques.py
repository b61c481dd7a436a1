from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import LogError
from wbc.measurement import Log, LogSource, rotor_torques
from wbc.transmission import Transmission


def test_every_way_a_drive_reports_torque_ends_on_the_rotor() -> None:
    time = np.arange(3.0)
    log = Log(
        time,
        {
            "a.rotor_torque": time,
            "a.motor_torque": 100.0 * time,
            "b.motor_torque": time,
            "c.current": time,
        },
        LogSource(ignored=("tau_x",)),
    )
    gears = Transmission(
        ("a", "b", "c"),
        np.array([20.0, -6.0, 9.0]),
        np.zeros(3),
        torque_constant=np.array([np.nan, np.nan, 0.1]),
    )
    np.testing.assert_allclose(rotor_torques(log, gears)[2], [2.0, -2.0 / 6.0, 0.2])
    with pytest.raises(LogError, match=r"needs torque_constant.* below \[gears\.c\]"):
        rotor_torques(log, gears.replace(torque_constant=np.full(3, np.nan)))
    more = Transmission(("a", "d"), np.ones(2), np.zeros(2))
    with pytest.raises(LogError, match=r"no torque of joint 'd'.*d\.current.*tau_x"):
        rotor_torques(log, more)
