"""A robot's losses as the numbers that `wbc.export.losses` works with."""

from __future__ import annotations

from pathlib import Path
from pprint import pformat
from typing import Any

import numpy as np

from wbc.effects import LoadPresliding, LoadStribeckFriction, Presliding, StribeckFriction
from wbc.errors import RobotError
from wbc.export.joint_numbers import joint_numbers
from wbc.files import as_json
from wbc.robot import Robot

_KINDS = (LoadPresliding, LoadStribeckFriction, Presliding, StribeckFriction)
TOLD = ("transmission_efficiency", *(kind.name for kind in _KINDS))
"""Names of the effects that these numbers hold beside what stands in every exported file."""


def loss_numbers(robot: Robot) -> dict[str, Any]:
    """Return the numbers of a robot's losses for `wbc.export.losses`, lists of names and arrays.

    Torques and inertias of gears (m,) stand at their outputs. What these numbers do not hold is in
    `export_robot(robot, "mujoco").unsaid`.

    Raises:
        RobotError: a gear with losses is self-locking.
    """
    gears = robot.transmission
    locking = np.flatnonzero(gears.backward_efficiency <= 0.0)
    if locking.size:
        raise RobotError(
            f"the gear of '{gears.joints[locking[0]]}' is self-locking (backward efficiency <= 0): "
            "its friction has no level that the torque of the motor gives. Export with --to mjcf, "
            "or give the gear a backward efficiency above 0."
        )
    found, size = joint_numbers(robot, TOLD), gears.size
    forward, backward = gears.forward_efficiency, gears.backward_efficiency
    length, coefficient, speed = np.zeros(size), np.zeros(size), np.ones(size)
    for effect in robot.effects:
        if isinstance(effect, LoadPresliding):
            length[gears.index(effect.where)] = effect.length
        elif isinstance(effect, LoadStribeckFriction):
            k = gears.index(effect.where)
            coefficient[k], speed[k] = effect.coefficient, effect.speed
    numbers = {
        "joints": list(gears.joints),
        "motor_from_joint": gears.motor_from_joint,
        "joint_from_motor": np.linalg.inv(gears.motor_from_joint),
        "gain": found.gain,
        "offset": found.offset,
        "share": 0.5 * (forward + 1.0 / backward),
        "forward_efficiency": forward,
        "backward_efficiency": backward,
        "gear_length": length,
        "slow_coefficient": coefficient,
        "slow_speed": speed,
        "rotor_inertia": gears.reflected_inertia,
        "rotor_damping": found.motor_damping,
        "rotor_friction": found.motor_friction,
        "joint_damping": found.damping[robot.actuated],
        "joint_friction": found.friction[robot.actuated],
    }
    beside = (("bristle", Presliding, "length"), ("stribeck", StribeckFriction, "speed"))
    for name, kind, shape in beside:
        effects = [effect for effect in robot.effects if isinstance(effect, kind)]
        rows = [np.eye(size)[gears.index(effect.where)] for effect in effects]
        numbers[f"{name}_place"] = np.reshape(rows, (len(effects), size))
        for value in ("level", shape):
            numbers[f"{name}_{value}"] = np.array([effect.values[value] for effect in effects])
    return numbers


def loss_module(robot: Robot) -> str:
    """Return the text of a Python file with a robot's losses, which needs NumPy only.

    Raises:
        RobotError: a gear with losses is self-locking.
    """
    table = pformat(as_json(loss_numbers(robot)), width=100, sort_dicts=False)
    code = Path(__file__).with_name("losses.py").read_text(encoding="utf-8")
    function = (
        "def losses(model: Any) -> Losses:\n"
        '    """Return the losses of this robot in a model of MuJoCo."""\n'
        "    return Losses(model, NUMBERS)\n"
    )
    named = "NUMBERS: Numbers = " + table + f'\n"""Losses of {robot.name}."""'
    return "\n\n".join((code, named + "\n", function))
