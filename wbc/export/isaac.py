"""Isaac Lab: the keyword arguments of an actuator configuration, and the links' inertias."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from wbc.arrays import FloatArray
from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import Lumped, links
from wbc.robot import Robot

_HEAD = '''\
"""Actuators of {name} for Isaac Lab on Isaac Sim 5.0 or newer, where friction is a torque [N m].

    from isaaclab.actuators import ImplicitActuatorCfg

    actuators = {{"drives": ImplicitActuatorCfg(**ACTUATORS, stiffness=..., damping=...)}}

stiffness and damping are the gains of your controller; damping of the joints stands under
viscous_friction. In Isaac Lab 3 effort_limit_sim and velocity_limit_sim are called
joint_effort_limit and joint_velocity_limit. DELAY is in seconds: DelayedPDActuatorCfg takes
min_delay and max_delay in physics steps. INERTIAS holds what the links have now: mass [kg], centre
and inertia about it [m, kg m^2] in the link's frame; `wbc export --to urdf` writes them as a model.
{comment}
"""
'''


def isaac(robot: Robot, found: JointNumbers) -> tuple[str, list[str]]:
    """Return a Python file of literals (`{comment}` left open), and what it cannot say."""
    at_joints = Lumped.of(robot, found)
    rows = dict(zip(robot.transmission.joints, robot.actuated, strict=True))

    def per_driven(values: FloatArray) -> dict[str, float]:
        given = {re.escape(joint): float(values[row]) for joint, row in rows.items()}
        return {joint: value for joint, value in given.items() if np.isfinite(value)}

    unsaid = list(at_joints.unsaid)
    for joint in robot.single_joints:
        row = robot.velocity_index(joint)
        if joint not in rows and (at_joints.damping[row] or at_joints.friction[row]):
            unsaid.append(
                f"friction of the undriven joint {joint} (dry {at_joints.friction[row]:.6g} N m, "
                f"viscous {at_joints.damping[row]:.6g} N m s/rad)"
            )
    actuators = {
        "joint_names_expr": [re.escape(joint) for joint in rows],
        "effort_limit_sim": per_driven(at_joints.limit),
        "velocity_limit_sim": per_driven(at_joints.speed),
        "armature": per_driven(at_joints.armature),
        "friction": per_driven(at_joints.friction),
        "dynamic_friction": per_driven(at_joints.friction),
        "viscous_friction": per_driven(at_joints.damping),
    }
    delays = dict(zip(rows, map(float, found.delay), strict=True))
    inertias = {
        link.name: {
            "mass": float(link.inertia.mass),
            "center": np.asarray(link.inertia.lever).tolist(),
            "inertia": np.asarray(link.inertia.inertia).tolist(),
        }
        for link in links(robot)
    }
    kept = {name: value for name, value in actuators.items() if value}
    parts = [_HEAD.replace("{name}", robot.name).replace("{{", "{").replace("}}", "}")]
    parts += [_literal("ACTUATORS", kept), _literal("DELAY", delays)]
    return "\n".join([*parts, _literal("INERTIAS", inertias)]), unsaid


def _literal(name: str, table: Mapping[str, object]) -> str:
    lines = [f"    {key!r}: {value!r}," for key, value in table.items()]
    return "\n".join([f"{name} = {{", *lines, "}", ""])
