import pytest

from wbc.errors import RobotError
from wbc.robot.dc_drive import DcDrive


def test_mean_voltage_balances_around_the_winding() -> None:
    drive = DcDrive(supply_voltage=12.0, source_resistance=0.5)
    duty, back_emf, resistance = 0.6, 2.0, 3.0
    current = float(drive.current(duty, back_emf, resistance))
    assert duty * (12.0 - 0.5 * current) == pytest.approx(resistance * current + back_emf)


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
