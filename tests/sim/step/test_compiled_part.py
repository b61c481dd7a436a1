"""The rows of a part of a step against pinocchio, on random robots, states and steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot, softened
from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim import Plane, Plant

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def contact_jacobian(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return H_l (nv, nv) and the Jacobians (k, 3, nv) of the contact points by pinocchio."""
    space = Workspace(robot)
    model, data = space.model, space.data
    upper = np.triu(pin.crba(model, data, q, pin.Convention.WORLD))
    rows = []
    for frame in space.frames:
        pin.updateFramePlacement(model, data, frame)
        whole = pin.getFrameJacobian(model, data, frame, _WORLD).reshape(6, -1)
        rows.append(np.array(whole[:3]))
    return upper + np.triu(upper, 1).T, np.reshape(rows, (-1, 3, model.nv))


def test_parts_of_random_robots_obey_pinocchio() -> None:
    """H_l, forces and rows in the middle of a part, and where it ends."""
    touched = parts = 0
    for seed in range(90):
        rng = np.random.default_rng(seed)
        robot = random_robot(rng, BASES[seed % 3], 0.7, 0.6, rng.uniform(0.0, 1.2), False)
        robot = softened(rng, robot) if seed % 4 == 1 else robot
        plant = Plant(robot, Plane.slope(0.2) if seed % 2 else Plane())
        model, data = robot.model, robot.model.createData()
        q = pin.integrate(model, robot.neutral(), rng.normal(size=model.nv) * 0.4)
        state = plant.state(q, 0.3 * rng.normal(size=model.nv), lifted=True)
        for _ in range(3):
            torque, external = 0.1 * rng.normal(size=(2, model.nv))
            result = plant.step(state, torque[: robot.transmission.size], 1e-3, external)
            state = result.state
            for part in result.parts:
                solution, middle, before = part.solution, part.end.before, part.end.speed
                program, scale = solution.program, 1.0 + np.abs(solution.velocity).max()
                inertia, jacobian = contact_jacobian(robot, middle)
                assert program.inertia == pytest.approx(inertia, rel=1e-10, abs=1e-10)
                if seed % 3 == 0:  # a fixed base; others obey their momentum instead
                    force = external - pin.nonLinearEffects(model, data, middle, before)
                    free = before + part.step * np.linalg.solve(inertia, force)
                    assert program.free_velocity == pytest.approx(free, abs=1e-8 * scale)
                if len(program.unilateral.normals):
                    pushes = np.einsum("kxv,kx->v", jacobian, part.contact_impulse)
                    rows, first = program.rows(), program.elements.size
                    own = rows[first:].T @ solution.impulse[first:]
                    size = 1.0 + np.abs(part.contact_impulse).max()
                    assert own == pytest.approx(pushes, abs=1e-9 * size)
                    touched += 1
                end = pin.integrate(model, middle, 0.5 * part.step * solution.velocity)
                if seed % 3 == 0 and not part.state.closed.any():
                    assert part.state.position == pytest.approx(end, abs=1e-12)
                assert solution.residuals.worst_speed < 1e-8 * scale
                assert solution.residuals.dynamics < 1e-8 * scale
                parts += 1
    assert parts > 200
    assert touched > 20
