"""Continuous joints of a URDF: joints with one position that never ends."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import load_robot
from wbc.identification import compare
from wbc.measurement import Log

LINK = (
    '<link name="{}"><inertial><origin xyz="0 0 -0.4"/><mass value="0.6"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
)
JOINT = (
    '<joint name="swing" type="continuous"><parent link="base"/><child link="rod"/>'
    '<axis xyz="0 1 0"/>{}</joint>'
)


@pytest.mark.parametrize("limit", ["", '<limit effort="5" velocity="8"/>'])
@pytest.mark.parametrize("base", ["fixed", "free_flyer"])
def test_a_continuous_joint_counts_its_turns(tmp_path, limit, base) -> None:
    text = f'<robot name="r">{LINK.format("base")}{LINK.format("rod")}{JOINT.format(limit)}</robot>'
    (tmp_path / "r.urdf").write_text(text)
    (tmp_path / "robot.toml").write_text(
        f'name = "r"\nmodel = "r.urdf"\nbase = "{base}"\n[gears.swing]\n'
        'gear_ratio = { value = 6.0, unit = "1", source = "sheet" }\n'
        'rotor_inertia = { value = 6e-5, unit = "kg m^2", source = "sheet" }\n'
        'forward_efficiency = { value = 1.0, unit = "1", source = "none" }\n'
    )
    robot = load_robot(str(tmp_path / "robot.toml"))
    assert robot.single_joints == ("swing",)
    row = robot.position_index("swing")
    assert robot.model.upperPositionLimit[row] == np.inf
    if base == "free_flyer":
        return
    time = np.arange(0.0, 8.0, 0.005)
    angle = 2.0 * np.pi * (1.0 - np.cos(0.8 * time))  # two turns and back
    model, data = robot.model, robot.model.createData()
    speed, rate = np.gradient(angle, time), np.gradient(np.gradient(angle, time), time)
    torque = np.array([
        pin.rnea(model, data, *map(np.atleast_1d, row))[0] + 6e-5 * 36.0 * row[2]
        for row in zip(angle, speed, rate, strict=True)
    ])  # fmt: skip
    log = Log(time, {"swing.position": angle, "swing.motor_torque": torque})
    found = compare(robot, [log]).outputs[0]
    assert found.rms < 0.02 * found.size
