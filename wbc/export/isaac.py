"""Isaac Lab: the keyword arguments of an actuator configuration, and the links' inertias."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from wbc.export.joint_numbers import JointNumbers
from wbc.export.parts import links, lumped, not_lumped
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
    driven, unsaid = robot.transmission.joints, list(not_lumped(robot, found))
    at_joints = lumped(robot, found)
    for joint in robot.single_joints:
        _, viscous, dry = at_joints[:, robot.velocity_index(joint)]
        if joint not in driven and (viscous or dry):
            unsaid.append(
                f"friction of the undriven joint {joint} (dry {dry:.6g} N m, viscous "
                f"{viscous:.6g} N m s/rad)"
            )
    armature, damping, friction = at_joints[:, robot.actuated]
    rows = {
        "effort_limit_sim": found.motor_limit,
        "velocity_limit_sim": found.motor_speed,
        "armature": armature,
        "friction": friction,
        "dynamic_friction": friction,
        "viscous_friction": damping,
    }
    names = [re.escape(joint) for joint in driven]
    actuators: dict[str, object] = {"joint_names_expr": names}
    for name, row in rows.items():
        given = {n: x for n, x in zip(names, row.tolist(), strict=True) if np.isfinite(x)}
        actuators |= {name: given} if given else {}
    delays = dict(zip(driven, found.delay.tolist(), strict=True))
    inertias = {
        link.name: {
            "mass": float(link.inertia.mass),
            "center": np.asarray(link.inertia.lever).tolist(),
            "inertia": np.asarray(link.inertia.inertia).tolist(),
        }
        for link in links(robot)
    }
    parts = [_HEAD.replace("{name}", robot.name).replace("{{", "{").replace("}}", "}")]
    parts += [_literal("ACTUATORS", actuators), _literal("DELAY", delays)]
    return "\n".join([*parts, _literal("INERTIAS", inertias)]), unsaid


def _literal(name: str, table: Mapping[str, object]) -> str:
    lines = [f"    {key!r}: {value!r}," for key, value in table.items()]
    return "\n".join([f"{name} = {{", *lines, "}", ""])
