"""Evaluated terms and the dissipative equation against derivatives, MuJoCo and brute force."""

from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest

from tests.control.scenes import center_of_mass, random_state
from tests.reference.test_mujoco import leg_model
from tests.sim.random_robots import geared
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.dynamics import dissipative_equation, evaluate, redundant_model
from wbc.errors import TransmissionError


def lossy(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return the robot with random efficiencies, the backward one also above the forward one."""
    m = robot.transmission.size
    forward, backward = rng.uniform(0.5, 1.0, m), rng.uniform(0.3, 1.0, m)
    return geared(robot, forward_efficiency=forward, backward_efficiency=backward)


def whole_solution(
    robot: Robot, q: FloatArray, v: FloatArray, tau: FloatArray, force: FloatArray
) -> list[tuple[FloatArray, FloatArray]]:
    """Solve H_s s_ddot + c_s - A' lambda = tau_s + tau_d with A s_ddot = 0, by brute force.

    The tooth friction of gear i is tau_d = -kappa |T| sgn(psi_dot) / N with T = (D' lambda)_i;
    kappa is 1/eta_f - 1 where T drives along the motion and 1 - eta_b where it brakes. Every sign
    pattern of T is tried; those that come out as assumed are solutions.
    """
    gears, nv, m = robot.transmission, robot.model.nv, robot.transmission.size
    model = redundant_model(robot, evaluate(robot, q, v))
    # The constraint's velocity is A ds = dq_m - D R dphi.
    a_matrix = np.hstack([np.eye(nv)[robot.actuated], -gears.topology @ gears.reduction])
    speed = gears.motor_from_joint @ v[robot.actuated]
    kappa_f = 1.0 / gears.forward_efficiency - 1.0
    kappa_b = 1.0 - gears.backward_efficiency
    right = np.concatenate([force, tau]) - model.bias
    found = []
    for signs in product((1.0, -1.0), repeat=m):
        sign = np.array(signs)
        kappa = np.where(sign * speed > 0.0, kappa_f, kappa_b)
        friction, drag = np.zeros((nv + m, m)), kappa * sign * np.sign(speed) / gears.gear_ratio
        friction[nv:] = -np.diag(drag) @ gears.topology.T
        system = np.block([[model.inertia, -a_matrix.T - friction], [a_matrix, np.zeros((m, m))]])
        solution = np.linalg.solve(system, np.concatenate([right, np.zeros(m)]))
        output = gears.topology.T @ solution[nv + m :]
        if np.all(output * sign >= 0.0):
            found.append((solution[:nv], np.sign(output * speed)))
    return found


FORMS = [(name, False) for name in ("planar_leg", "planar_leg_fixed", "parallelogram_leg")]


@pytest.mark.parametrize(("name", "coupled"), [*FORMS, ("parallelogram_leg", True)])
def test_redundant_and_reduced_forms_agree(name: str, coupled: bool) -> None:
    rng = np.random.default_rng(11)
    base = replace(load_robot(name), rotors_turn_with_links=coupled)
    modes, compared = set(), 0
    for seed in range(60):
        robot = lossy(base, rng)
        q, v = random_state(robot, np.random.default_rng(seed), spread=1.5)
        tau, force = rng.normal(size=2), rng.normal(scale=20.0, size=robot.model.nv)
        solutions = whole_solution(robot, q, v, tau, force)
        assert coupled or len(solutions) == 1
        for acceleration, directions in solutions:
            equation = dissipative_equation(robot, evaluate(robot, q, v), directions)
            found = equation.acceleration(tau, force)
            np.testing.assert_allclose(found, acceleration, rtol=1e-8, atol=1e-8)
            modes.add(tuple(directions))
            compared += 1
    assert len(modes) == 4
    assert compared >= 60


def test_a_self_locking_gear_is_never_driven_backward() -> None:
    robot = geared(load_robot("planar_leg"), backward_efficiency=0.0)
    q, v = random_state(robot, np.random.default_rng(0), spread=1.5)
    with pytest.raises(TransmissionError, match="self-locking"):
        dissipative_equation(robot, evaluate(robot, q, v), -np.ones(2))


def test_lossless_accelerations_are_those_of_mujoco_with_armature() -> None:
    robot = load_robot("planar_leg")
    gears = robot.transmission
    model = leg_model(armature=gears.reflected_inertia[0], ground=False)
    q, v = random_state(robot, np.random.default_rng(4), spread=1.5)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    torque = np.array([0.4, -0.2])
    data.ctrl[:] = gears.gear_ratio * torque
    mujoco.mj_forward(model, data)
    equation = dissipative_equation(robot, evaluate(robot, q, v), np.zeros(2))
    ours = equation.acceleration(torque, np.zeros(robot.model.nv))
    np.testing.assert_allclose(ours, data.qacc, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["planar_leg", "differential_biped", "solo12"])
def test_the_center_of_mass_outlives_the_terms_it_came_from(name: str) -> None:
    robot = load_robot(name)
    for seed in range(5):
        q, v = random_state(robot, np.random.default_rng(seed), spread=1.5)
        found = evaluate(robot, q, v).center_of_mass
        for _ in range(3):
            evaluate(robot, robot.neutral(), v)  # writes where the first terms had their memory
        assert np.allclose(found, center_of_mass(robot, q), atol=1e-12)
