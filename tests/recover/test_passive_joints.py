"""A joint without a gear rubs and has an encoder, too: in the plant, and found in its logs."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction, PositionOffset, ViscousFriction, load_robot
from wbc.identification import compare, diagnose
from wbc.measurement import Log
from wbc.robot import Effect, Robot
from wbc.sim import Plant
from wbc.transmission import Transmission

STEP = 2e-3
SOFT = 0.005  # [rad/s], over which dry friction of the integrated arm changes its sign


@pytest.fixture
def hanging() -> Robot:
    """Return a driven arm from which a link hangs that nothing drives."""
    model, joint = pin.Model(), 0
    for name, height, mass, reach in (("shoulder", 0.0, 1.0, 0.2), ("pivot", -0.4, 0.8, 0.25)):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, name)
        body = pin.Inertia(mass, np.array([0.0, 0.0, -reach]), np.diag([0.01, 0.01, 0.001]))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return Robot("hanging", model, Transmission(("shoulder",), np.array([10.0]), np.array([1e-4])))


def swung(robot: Robot, effect: Effect, seed: int, duration: float = 8.0) -> Log:
    """Return a log of the arm driven along a sum of waves, by a solver of differential equations.

    The plant's own step damps the motion a little, which is truly seen in its logs.
    """
    noise = np.random.default_rng(seed)
    waves = noise.uniform(0.3, 1.2, 4), noise.uniform(0.0, 6.0, 4), noise.uniform(0.2, 0.5, 4)
    values = effect.values if effect.where == "pivot" else {}
    model = robot.model.copy()
    model.armature = np.array([robot.transmission.reflected_inertia[0], 0.0])
    data = model.createData()

    def command(time: float, state: FloatArray) -> float:
        wanted = float(np.sum(waves[2] * np.sin(6.28 * waves[0] * time + waves[1])))
        return 30.0 * (wanted - state[0]) - 3.0 * state[2]

    def rate(time: float, state: FloatArray) -> FloatArray:
        dry = values.get("level", 0.0) * np.tanh(state[3] / SOFT)
        rubs = -dry - values.get("coefficient", 0.0) * state[3]
        torque = np.array([command(time, state), rubs])
        return np.concatenate([state[2:], pin.aba(model, data, state[:2], state[2:], torque)])

    times = STEP * np.arange(int(duration / STEP))
    path = solve_ivp(rate, (0.0, duration), np.zeros(4), "LSODA", times, max_step=STEP).y.T
    torque = np.array([command(t, state) for t, state in zip(times, path, strict=True)])
    seen = path[:, :2] + noise.normal(0.0, 2e-5, (times.size, 2))
    seen[:, 1] += values.get("offset", 0.0)
    columns = {"shoulder.position": seen[:, 0], "pivot.position": seen[:, 1]}
    columns["shoulder.motor_torque"] = torque + noise.normal(0.0, 5e-3, times.size)
    return Log(times, columns)


def test_a_passive_joint_is_a_place_and_a_base_is_none(hanging: Robot) -> None:
    assert hanging.passive_joints == ("pivot",)
    assert "pivot" in CoulombFriction.places(hanging)
    assert load_robot("planar_leg").passive_joints == ()
    assert "base_z" not in CoulombFriction.places(load_robot("planar_leg"))


def test_the_plant_brings_a_rubbing_passive_joint_to_rest(hanging: Robot) -> None:
    rubbing = hanging.with_effects(CoulombFriction("pivot", 0.1), ViscousFriction("shoulder", 1.0))
    plant = Plant(rubbing)
    state = plant.state(np.array([0.0, 0.5]))
    energy = [plant.mechanical_energy(state)]
    for _ in range(3000):
        state = plant.step(state, np.zeros(1), STEP).state
        energy.append(plant.mechanical_energy(state))
    assert np.max(np.diff(energy)) < 1e-4
    # A link of 0.8 kg at 0.25 m is held up to 51 mrad off the vertical by 0.1 N m.
    assert np.abs(state.velocity).max() < 1e-3
    assert abs(state.position.sum()) < 0.053
    free = Plant(hanging.with_effect(ViscousFriction("shoulder", coefficient=1.0)))
    swinging = free.state(np.array([0.0, 0.5]))
    for _ in range(500):
        swinging = free.step(swinging, np.zeros(1), STEP).state
    assert np.abs(swinging.velocity[1]) > 0.01


@pytest.mark.parametrize(
    "effect",
    [CoulombFriction("pivot", 0.08), ViscousFriction("pivot", 0.03), PositionOffset("pivot", 0.05)],
)
def test_what_a_passive_joint_has_is_found(hanging: Robot, effect: Effect) -> None:
    logs = [swung(hanging, effect, seed) for seed in (1, 2)]
    found = diagnose(hanging, logs, [CoulombFriction, ViscousFriction, PositionOffset])
    assert [f.effect.key for f in found.findings] == [effect.key]
    ((number, value),) = effect.values.items()
    assert found.findings[0].parameters[number].value == pytest.approx(value, rel=0.05)
    # Smoothing rounds the jump of the friction: with the reversals this was 4.1 noise floors.
    pivot = compare(hanging.with_effect(effect), logs).outputs[1]
    assert pivot.output == "pivot"
    assert pivot.ratio < 2.0
