"""Parts of steps and impacts of random robots against pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.random_robots import BASES, random_robot, softened
from wbc.dynamics import evaluate
from wbc.robot import Robot
from wbc.sim import Plane, Plant, SimState, StepSolution
from wbc.transmission import Transmission


def contact_jacobian(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return H_l (nv, nv) and the Jacobians (k, 3, nv) of the contact points by pinocchio."""
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    return terms.mass_matrix, terms.contact_jacobian.reshape(-1, 3, robot.model.nv)


def turning() -> Robot:
    """A chain whose first joint turns without end."""
    model = pin.Model()
    for kind in (pin.JointModelRUBX(), pin.JointModelPZ(), pin.JointModelRY()):
        joint = model.addJoint(model.njoints - 1, kind, pin.SE3.Random(), f"j{model.njoints}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Random())
    return Robot("chain", model, Transmission(("j2",), np.array([10.0]), np.array([1e-3])))


def test_parts_of_random_robots_obey_pinocchio() -> None:
    """H_l, forces and rows in the middle of a part, and where it ends."""
    touched = parts = 0
    for seed in range(91):
        rng = np.random.default_rng(seed)
        robot = random_robot(rng, BASES[seed % 3], 0.7, 0.6, rng.uniform(0.0, 1.2), False)
        robot = softened(rng, robot) if seed % 4 == 1 else robot
        robot = turning() if seed == 90 else robot
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
                if len(program.frictions):
                    pushes = np.einsum("kxv,kx->v", jacobian, part.contact_impulse)
                    first = len(program.laws)
                    own = program.rows[first:].T @ solution.impulse[first:]
                    size = 1.0 + np.abs(part.contact_impulse).max()
                    assert own == pytest.approx(pushes, abs=1e-9 * size)
                    touched += 1
                end = pin.integrate(model, middle, 0.5 * part.step * solution.velocity)
                if seed % 3 == 0 and not part.state.closed.any():
                    assert part.state.position == pytest.approx(end, abs=1e-12)
                _hold(solution, 1e-8 * scale)
                parts += 1
    assert parts > 200
    assert touched > 20


def _hold(solution: StepSolution, bound: float) -> None:
    """Hold a solution against the momentum balance and the laws of its rows."""
    program = solution.program
    moved = program.inertia @ (solution.velocity - program.free_velocity)
    assert np.abs(moved - program.rows.T @ solution.impulse).max() < bound
    assert solution.residuals.max(initial=0.0) < bound


def _hits(plant: Plant, state: SimState) -> int:
    """Hold the impacts of a step against the momentum balance; return how many there were."""
    robot = plant.robot
    gears = np.zeros((robot.transmission.size, robot.model.nv))
    gears[:, robot.actuated] = robot.transmission.motor_from_joint
    result = plant.step(state, np.zeros(len(gears)), 1e-7)
    inertia, jacobian = contact_jacobian(robot, state.position)
    for hit in result.impacts:
        scale = 1.0 + np.abs(hit.before).max()
        pushes = np.einsum("kxv,kx->v", jacobian, hit.contact_impulse)
        pushes += gears.T @ hit.solution.impulse[: len(gears)]
        size = 1.0 + np.abs(pushes).max()
        assert inertia @ (hit.after - hit.before) == pytest.approx(pushes, abs=1e-5 * size)
        turned = robot.transmission.reflected_inertia
        had, has = (
            0.5 * v @ inertia @ v + 0.5 * turned @ (gears @ v) ** 2 for v in (hit.before, hit.after)
        )
        assert hit.mesh_loss + hit.contact_loss == pytest.approx(had - has, abs=1e-5 * scale**2)
        assert min(hit.mesh_loss, hit.contact_loss) > -1e-9 * scale**2
        _hold(hit.solution, 1e-8 * scale)
    return len(result.impacts)


def test_random_robots_hit_the_ground() -> None:
    hits = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        eta = rng.uniform(0.5, 1.0, 2)
        robot = random_robot(rng, BASES[seed % 3], eta[0], eta[1], rng.uniform(0.0, 1.2), False)
        q = robot.neutral()
        q[robot.actuated_position] = rng.uniform(-1.0, 1.0, robot.transmission.size)
        lowest = Plant(robot, Plane(height=-20.0))
        plant = Plant(robot, Plane(height=-20.0 + float(lowest.gaps(lowest.state(q)).min())))
        hits += _hits(plant, plant.state(q, 3.0 * rng.normal(size=robot.model.nv)))
    assert hits > 40
