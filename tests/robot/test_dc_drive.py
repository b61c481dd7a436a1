import numpy as np
import pytest

from wbc.errors import RobotError
from wbc.robot.dc_drive import DcDrive


def test_stall_current_is_supply_over_all_resistance_at_full_duty() -> None:
    drive = DcDrive(supply_voltage=7.4, source_resistance=0.7)
    assert drive.current(1.0, 0.0, 3.0) == pytest.approx(7.4 / 3.7)
    assert drive.current(-1.0, 0.0, 3.0) == pytest.approx(-7.4 / 3.7)


def test_mean_voltage_balances_around_the_winding() -> None:
    drive = DcDrive(supply_voltage=12.0, source_resistance=0.5)
    duty, back_emf, resistance = 0.6, 2.0, 3.0
    current = float(drive.current(duty, back_emf, resistance))
    assert duty * (12.0 - 0.5 * current) == pytest.approx(resistance * current + back_emf)


def test_no_load_speed_carries_no_current() -> None:
    assert DcDrive(6.0).current(0.5, 3.0, 2.0) == pytest.approx(0.0)


def test_limits_hold() -> None:
    drive = DcDrive(12.0, current_limit=1.0, duty_limit=0.9)
    assert drive.current([1.0, -1.0], [0.0, 0.0], 2.0) == pytest.approx([1.0, -1.0])
    assert drive.duty(10.0, [0.05, 1.0, -1.0]) == pytest.approx([0.5, 0.9, -0.9])


@pytest.mark.parametrize(
    "wrong",
    [
        {"supply_voltage": 0.0},
        {"supply_voltage": 5.0, "source_resistance": -0.1},
        {"supply_voltage": 5.0, "current_limit": 0.0},
        {"supply_voltage": 5.0, "duty_limit": 1.2},
    ],
)
def test_refuses_what_no_drive_can_be(wrong: dict[str, float]) -> None:
    name = list(wrong)[-1]
    with pytest.raises(RobotError, match=name):
        DcDrive(**wrong)


def test_sag_grows_with_duty() -> None:
    weak, stiff = DcDrive(7.4, source_resistance=2.0), DcDrive(7.4)
    duty = np.array([0.2, 0.6, 1.0])
    lost = 1.0 - weak.current(duty, 0.0, 3.0) / stiff.current(duty, 0.0, 3.0)
    assert np.all(np.diff(lost) > 0.0)
