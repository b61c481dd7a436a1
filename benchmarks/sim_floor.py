"""The least that a step costs in Python: its library calls and nothing else.

What a step cannot do without is called once each, on arrays that are ready: the kinematics and
inertia of the middle configuration, the contact Jacobians, one Cholesky solve for the rows'
response, one matrix of the rows, one LU solve for their impulses, and the sums between. No checks,
no branches, no objects, no warm start, no residual.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from benchmarks.sim_cases import DT, Case
from wbc.dynamics import Workspace
from wbc.sim import Plant

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def bare_step(case: Case) -> Callable[[], np.ndarray]:
    """Return a function that makes the library calls of the case's first step."""
    robot, state, command = case.robot, case.start, case.command()
    result = Plant(robot).step(state, command(state.position, state.velocity), DT)
    program = result.solutions[0].program
    unilateral, gears = program.unilateral, program.elements.rows
    axes = np.eye(3)[[2, 0, 1]][: 1 + unilateral.tangent_size]
    space, half = Workspace(robot), 0.5 * DT
    model, data, frames = space.model, space.data, space.frames
    touching = len(unilateral.normals)
    q, v = state.position, state.velocity
    size = len(gears) + touching * len(axes)
    on_impulse, constant = np.eye(size), np.zeros(size)

    def step() -> np.ndarray:
        middle = pin.integrate(model, q, half * v)
        inertia = pin.crba(model, data, middle, pin.Convention.WORLD)
        bias = pin.nonLinearEffects(model, data, middle, v)
        contacts = np.empty((len(frames), 3, model.nv))
        for i, frame in enumerate(frames):
            pin.updateFramePlacement(model, data, frame)
            contacts[i] = pin.getFrameJacobian(model, data, frame, _WORLD)[:3]
        ground = (axes @ contacts)[:touching].reshape(-1, model.nv)
        matrix = np.concatenate((gears, ground, -DT * bias[None]))
        _, response, _ = lapack.dposv(inertia, matrix.T)
        free = v + response[:, -1]
        delassus = matrix[:-1] @ response[:, :-1]
        right = constant - matrix[:-1] @ free
        _, _, impulse, _ = lapack.dgesv(delassus + on_impulse, right)
        after = free + response[:, :-1] @ impulse
        return pin.integrate(model, middle, half * after)

    return step
