"""Friction with a memory, under load or by direction: the plant beside independent integration."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import effects, load_robot
from wbc.arrays import FloatArray
from wbc.effects import LoadPresliding, LoadStribeckFriction, Presliding
from wbc.errors import EffectError
from wbc.robot import Effect, Motion
from wbc.sim import EnergyAudit, EnergyFlow, Plane, Plant
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout
from wbc.transmission import mesh_input

LEG = load_robot("planar_leg_fixed").lossless()
START, RATIO, FAR = np.array([0.3, -0.6]), 20.0, Plane(height=-9.0)
LEVEL, ETA_F, ETA_B, LENGTH, SHARE, SPEED = 0.8, 0.7, 0.6, 0.05, 0.5, 5.0
MEAN, DIFFERENCE = 0.5 * (1.0 / ETA_F - ETA_B), 0.5 * (1.0 / ETA_F + ETA_B) - 1.0


class Case(NamedTuple):
    """An effect at the knee, its law, and the motion that shows it.

    The law gives, for speed, bend z of bristles and sign of the mesh torque, what share of that
    torque comes out of the gear, and what resists the joint [N m]. `close` is how far from the
    truth steps of 0.25 ms may end.
    """

    effect: Effect
    law: Callable[[float, float, float], tuple[float, float]]
    push: Callable[[float], tuple[float, float]]
    close: float
    start: tuple[float, float, float, float] = (0.3, -0.6, 0.0, 0.0)
    duration: float = 0.5


def to_and_fro(t: float) -> tuple[float, float]:
    """Return rotor torques [N m] that move both joints back and forth under changing loads."""
    return 0.25 * np.sin(17.0 * t), 0.25 * np.sin(23.0 * t + 1.0)


def one_way(t: float) -> tuple[float, float]:
    """Return rotor torques that turn the knee one way, under a load that changes its sign."""
    return 0.1 * np.sin(9.0 * t), 0.02 + 0.2 * np.sin(17.0 * t)


CASES = {
    "presliding": Case(
        Presliding("knee", LEVEL, LENGTH), lambda v, z, s: (1.0, LEVEL * z), to_and_fro, 2e-3
    ),
    "load_presliding": Case(
        LoadPresliding("knee", ETA_F, ETA_B, LENGTH),
        lambda v, z, s: (1.0 / (1.0 + MEAN * s * z + DIFFERENCE * z**2), 0.0),
        to_and_fro,
        8e-3,
        duration=0.3,
    ),
    "load_stribeck_friction": Case(
        LoadStribeckFriction("knee", SHARE, SPEED),
        lambda v, z, s: (1.0 - s * np.sign(v) * SHARE * np.exp(-((v / SPEED) ** 2)), 0.0),
        one_way,
        2e-2,
        (0.3, -1.2, 0.0, 3.0),
        0.3,
    ),
    "directional_viscous_friction": Case(
        effects.DirectionalViscousFriction("knee", 0.5, 0.2),
        lambda v, z, s: (1.0, (0.5 if v > 0.0 else 0.2) * v),
        to_and_fro,
        5e-3,
    ),
}


class Run(NamedTuple):
    """Rows (N, 5) of q, v and z after each step, and the books of energy."""

    rows: FloatArray
    memory: tuple[FloatArray, ...]
    audit: EnergyAudit
    least: float


@cache
def run_of(name: str, h: float, with_effect: bool = True) -> Run:
    case = CASES[name]
    plant = Plant(LEG.with_effect(case.effect) if with_effect else LEG, FAR)
    state = plant.state(case.start[:2], case.start[2:])
    before, flow, least, rows = plant.mechanical_energy(state), EnergyFlow(), 0.0, []
    for i in range(round(case.duration / h)):
        result = plant.step(state, np.array(case.push((i + 0.5) * h)), h)
        state, flow = result.state, flow + result.energy
        least = min(least, *result.energy.losses.values())
        # A step's own error, which shrinks with h, may be named.
        assert all(event.kind == "coarse" for event in result.events)
        z = state.memory[0][0] if state.memory else 0.0
        rows.append((*state.position, *state.velocity, z))
    audit = EnergyAudit(flow, plant.mechanical_energy(state) - before)
    return Run(np.array(rows), state.memory, audit, least)


def truth(case: Case) -> FloatArray:
    """Return q, v and z at the end, with the sign of the mesh torque found by trying both."""
    rotor, data, signs = LEG.transmission.reflected_inertia, LEG.model.createData(), set()

    def rate(t: float, y: FloatArray) -> FloatArray:
        q, v, z = y[:2], y[2:4], y[4]
        inertia = pin.crba(LEG.model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        bias, drive = pin.nle(LEG.model, data, q, v), RATIO * np.array(case.push(t))
        for sign in (1.0, -1.0):
            out, resists = case.law(v[1], z, sign)
            gain = np.array([1.0, out])
            right = gain * drive - bias - [0.0, resists]
            a = np.linalg.solve(inertia + np.diag(gain * rotor), right)
            if (drive[1] - rotor[1] * a[1]) * sign >= 0.0:
                break
        signs.add(sign)
        return np.concatenate((v, a, [(v[1] - abs(v[1]) * z) / LENGTH]))

    span, exact = (0.0, case.duration), {"rtol": 1e-6, "atol": 1e-8, "max_step": 5e-3}
    path = solve_ivp(rate, span, [*case.start, 0.0], **exact).y
    assert signs == {1.0, -1.0}
    assert case.push is to_and_fro or path[3].min() > 0.05
    return path[:, -1]


@pytest.mark.parametrize("name", CASES)
def test_the_plant_moves_as_an_independent_integration_and_its_books_close(name: str) -> None:
    end = truth(CASES[name])
    coarse, fine = (run_of(name, h) for h in (1e-3, 2.5e-4))
    seen = 5 if coarse.memory else 4
    errors = [np.abs(run.rows[-1] - end)[:seen].max() for run in (coarse, fine)]
    assert errors[1] < min(CASES[name].close, 0.4 * errors[0])
    without = run_of(name, 1e-3, with_effect=False)
    assert np.abs(without.rows[-1] - end)[:4].max() > 8.0 * errors[1]  # the loss matters
    assert min(coarse.least, fine.least) >= -1e-12
    assert abs(fine.audit.residual) < 0.4 * abs(coarse.audit.residual)
    flow = fine.audit.flow
    assert abs(fine.audit.residual) < 0.1 * (flow.lost + abs(flow.effects))


@pytest.mark.parametrize("name", ["presliding", "load_presliding"])
def test_bristles_have_lines_of_their_own_in_the_books(name: str) -> None:
    """The store is level h z^2 / 2 at the end."""
    run = run_of(name, 2.5e-4)
    (memory,), flow = run.memory, run.audit.flow
    assert flow.bristles > 0.0
    assert flow.effects == 0.0  # no other effect does work
    level = LEVEL if len(memory) == 1 else MEAN * abs(memory[1])
    assert flow.bent == pytest.approx(0.5 * level * LENGTH * memory[0] ** 2, abs=1e-12)
    assert (flow.reloaded == 0.0) == (len(memory) == 1)
    assert "stored in bristles" in str(run.audit)
    assert abs(run.audit.residual) < 0.02 * flow.lost


def test_at_its_ends_the_law_is_that_of_the_efficiencies() -> None:
    robot, n = LEG.with_effect(LoadPresliding("knee", ETA_F, ETA_B, 1e-4)), 200
    q, v = np.zeros((n, 2)), np.zeros((n, 2))
    q[:, 1] = np.linspace(-1.0, 1.0, n)
    v[:, 1] = 1.0
    loads = np.random.default_rng(1).normal(size=(n, 2))
    for way in (1.0, -1.0):
        motion = Motion(way * q, way * v, np.zeros((n, 2)), time=np.arange(n) * 0.01)
        expected = mesh_input(loads, way * v, np.array([1.0, ETA_F]), np.array([1.0, ETA_B]))
        found = robot.effects[0].meshed(robot, motion, loads, np.array(loads))
        np.testing.assert_allclose(found[1:, 1], expected[1:, 1], rtol=1e-12)
    # A single sample, all that a controller knows, has no z: the efficiencies hold.
    one, load = Motion(q[0], v[0], np.zeros(2)), loads[0]
    assert robot.effects[0].meshed(robot, one, load, load) is load
    assert robot.transmission.forward_efficiency[1] == ETA_F


@pytest.mark.parametrize("length", [0.0, 1e-6, 1e-3])
@pytest.mark.parametrize("h", [2e-3, 1e-2])
def test_no_step_is_too_long_for_stiff_bristles(length: float, h: float) -> None:
    """A joint that hangs at rest below its friction stays there, and comes to rest there."""
    plant = Plant(LEG.with_effect(Presliding("knee", 5.0, length)), FAR)
    state = plant.state(np.zeros(2), [0.0, 0.5])
    highest = plant.mechanical_energy(state)
    for _ in range(round(1.0 / h)):
        state = plant.step(state, np.zeros(2), h).state
        assert plant.mechanical_energy(state) < highest + 0.05 * abs(highest) + 0.05
    assert abs(state.velocity[1]) < 0.1


def test_where_no_memory_is_known_bristles_act_as_coulomb_friction() -> None:
    effect, dry = Presliding("knee", LEVEL, LENGTH), effects.CoulombFriction("knee", LEVEL)
    sample = Motion(START, np.array([0.1, -0.4]))
    assert effect.joint_torque(LEG, sample) is None
    level, known = (one.joint_friction(LEG, sample) for one in (effect, dry))
    np.testing.assert_array_equal(level, known)
    under_load = LoadPresliding("knee", 0.8, 0.7, 0.02)
    assert under_load.rotor_torque(LEG, sample) is None
    assert under_load.memory_energy(LEG, sample) is None
    for one in (effect, under_load):
        with pytest.raises(EffectError, match=rf"{one.name} at 'knee' has no state"):
            one.next_memory(LEG, sample, np.zeros(2))
    with pytest.raises(EffectError, match="backward_efficiency"):
        LoadPresliding("knee", 0.4, -0.5, 0.02)


@pytest.mark.parametrize(("speed", "holds"), [(0.0, True), (-4.0, False)])
def test_a_weight_that_is_held_at_rest_runs_once_it_moves(speed: float, holds: bool) -> None:
    """The gear at rest carries 1 / (1 - c) to 1 / (1 + c) of the load; in motion it does not."""
    robot = LEG.with_effects(*(LoadStribeckFriction(j, SHARE, 0.3) for j in ("hip", "knee")))
    plant, at = Plant(robot, FAR), np.array([0.9, 0.0])
    load = pin.rnea(LEG.model, LEG.model.createData(), at, *np.zeros((2, 2)))
    state = plant.run(plant.state(at, [speed, 0.0]), 0.8 * load / RATIO, 0.2, 200)[-1].state
    assert (np.abs(state.velocity).max() < 1e-9) == holds
    assert (np.abs(state.position - at).max() < 1e-9) == holds


def test_servo_rollouts_stick_under_load_and_slide_once_they_move() -> None:
    """What holds the resting pendulum at 0.4 rad, switched off, lets it fall where it moves."""

    def final(coefficient: float, enabled: float) -> float:
        robot = load_robot("xl330_pendulum").with_effects(
            LoadStribeckFriction("shaft", coefficient, 0.05),
            effects.EFFECTS["rotor_coulomb_friction"].at("shaft", {"level": 0.11}),
        )
        run = ServoRun("", 2.0, np.zeros(200), np.full(200, enabled), np.full(200, 0.4))
        return float(servo_rollout([(robot, DcDrive(7.4))], [run], 0.005)[-1, 0, 0])

    assert final(0.9, 0.0) == pytest.approx(0.4, abs=1e-12)
    assert final(0.0, 0.0) < 0.39
    assert abs(final(0.9, 1.0)) < 0.1


@pytest.mark.parametrize(("temperature", "drag"), [(None, 0.4), (60.0, 0.4 * np.exp(-0.6))])
def test_the_plant_drags_as_its_temperature_says(temperature: float | None, drag: float) -> None:
    warm = None if temperature is None else np.full(2, temperature)
    thermal = LEG.with_effect(effects.ThermalViscousFriction("knee", 0.4, 0.03))
    plain = LEG.with_effect(effects.ViscousFriction("knee", drag))
    ends = [
        plant.step(plant.state(START, [0.0, 2.0]), np.zeros(2), 1e-3).state.velocity
        for plant in (Plant(thermal, FAR, temperature=warm), Plant(plain, FAR))
    ]
    np.testing.assert_allclose(*ends, rtol=1e-12)
