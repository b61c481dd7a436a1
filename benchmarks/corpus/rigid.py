"""Rigid-body dynamics of a machine by MuJoCo."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np

from benchmarks.corpus.machine import Machine


class Rigid:
    """MuJoCo model of a machine's links, without rotors, contacts or losses."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.model = mujoco.MjModel.from_xml_string(mjcf(machine))
        self.model.opt.gravity[:] = machine.gravity
        self.data = mujoco.MjData(self.model)
        self.size = int(self.model.nv)

    def torque(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return M a + h, (N, nv)."""
        result = np.empty_like(v)
        data, model = self.data, self.model
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
            mujoco.mj_inverse(model, data)
            result[k] = data.qfrc_inverse
        return result

    def mass_and_bias(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return M (nv, nv) and h (nv,) at one sample."""
        data, model = self.data, self.model
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass = np.empty((self.size, self.size))
        column = np.empty(self.size)
        for k, unit in enumerate(np.eye(self.size)):
            mujoco.mj_mulM(model, data, column, unit)
            mass[k] = column
        return mass, data.qfrc_bias.copy()

    def contact_jacobians(self, q: np.ndarray) -> np.ndarray:
        """Return the Jacobians of all contact points, (3 c, nv), world axes."""
        data, model = self.data, self.model
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rows = []
        for _, number, point in self.machine.contacts:
            body = number + 1
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
            jacobian = np.zeros((3, self.size))
            mujoco.mj_jac(model, data, jacobian, None, place, body)
            rows.append(jacobian)
        return np.concatenate(rows)


def mjcf(machine: Machine) -> str:
    """Return the links of a machine, with its contact points as sites."""

    def numbers(values: Iterable[float]) -> str:
        return " ".join(f"{float(value):.17g}" for value in values)

    def body(k: int) -> str:
        link = machine.links[k]
        joint = f'<joint name="{link.joint}" type="{link.kind}" axis="{numbers(link.axis)}"/>'
        if link.kind == "free":
            joint = f'<freejoint name="{link.joint}"/>'
        sites = "".join(
            f'<site name="{name}" pos="{numbers(point)}"/>'
            for name, number, point in machine.contacts
            if number == k
        )
        inertia = numbers(link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        inner = "".join(body(i) for i, child in enumerate(machine.links) if child.parent == k)
        return (
            f'<body name="{link.name}" pos="{numbers(link.origin)}">{joint}'
            f'<inertial pos="{numbers(link.com)}" mass="{link.mass:.17g}" fullinertia="{inertia}"/>'
            f"{sites}{inner}</body>"
        )

    world = "".join(body(k) for k, link in enumerate(machine.links) if link.parent < 0)
    return (
        '<mujoco><compiler autolimits="false"/><option><flag contact="disable"/></option>'
        f"<worldbody>{world}</worldbody></mujoco>"
    )
