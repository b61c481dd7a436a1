"""The corpus' plants against one another, and the library's effects against the plants."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import BY_CONDITIONS, LATER, LISTED, ONLY_PRESCRIBED
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import draw_machine
from benchmarks.corpus.flaws import AT_MOTORS, WHOLE_ROBOT, Flaw
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.planar import PlanarLinks
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.rigid import Rigid
from benchmarks.corpus.sensors import Sensors
from benchmarks.corpus.trial import logs_of, robot_of
from wbc.effects import EFFECTS
from wbc.identification import compare, rank_robots
from wbc.identification.model import estimation_problem

SENSORS = Sensors(rate=250.0, position=2e-5, bits=18, velocity=3e-3, torque=0.005, force=0.3)


def recorded(machine: Machine, flaws: tuple[Flaw, ...], kinds: tuple[str, ...]) -> Case:
    noise = 0.02 * np.ones(len(machine.driven))
    runs = tuple(Excitation(kind, 10 + k, 3.0, 20 + k) for k, kind in enumerate(kinds))
    sensors = replace(SENSORS, conditions=any(flaw.effect in BY_CONDITIONS for flaw in flaws))
    return Case(0, machine, flaws, runs, "fair", sensors, noise)


def flaw_of(effect: str, machine: Machine) -> Flaw:
    first, middle, last = (machine.driven[k] for k in (0, len(machine.driven) // 2, -1))
    torque = {"pendulum": 1.0, "arm3": 4.0}.get(machine.family, 2.0)
    losses = {"forward_efficiency": 0.75, "backward_efficiency": 0.65}
    directions = {"positive_direction": 0.2 * torque, "negative_direction": 0.05 * torque}
    values = {
        "viscous_friction": {"coefficient": 0.2 * torque},
        "coulomb_friction": {"level": 0.2 * torque},
        "rotor_viscous_friction": {"coefficient": 0.2 * torque},
        "rotor_coulomb_friction": {"level": 0.2 * torque},
        "stribeck_friction": {"level": 0.2 * torque, "speed": 0.5},
        "presliding": {"level": 0.2 * torque, "length": 0.05},
        "directional_viscous_friction": directions,
        "load_presliding": {**losses, "length": 0.05},
        "thermal_viscous_friction": {"coefficient": 0.3 * torque, "rate": 0.03},
        "voltage_scaling": {"share": 0.9, "nominal": 24.0},
        "load_friction": {"coefficient": 0.15},
        "load_stribeck_friction": {"coefficient": 0.3, "speed": 0.5},
        "quadratic_drag": {"coefficient": 0.1 * torque},
        "transmission_efficiency": {"forward_efficiency": 0.8, "backward_efficiency": 0.7},
        "rotor_inertia": {"reflected_inertia": 2.5 * machine.reflected[-1]},
        "payload_mass": {"mass": 0.2},
        "center_of_mass": {"x": 0.03, "y": 0.0, "z": -0.02},
        "joint_spring": {"stiffness": 0.5 * torque, "rest": 0.2},
        "joint_compliance": {"stiffness": 150.0 * torque, "damping": 3.0},
        "torque_constant": {"factor": 1.15},
        "torque_offset": {"offset": 0.2 * torque},
        "torque_ripple": {"amplitude": 0.2, "order": 6.0, "phase": 1.0},
        "actuation_delay": {"delay": 0.01},
        "position_offset": {"offset": 0.08},
        "gravity_direction": {"roll": 0.05, "pitch": 0.05},
        "supply_sag": {"coefficient": 0.003},
        "thermal_drift": {"rate": 0.04, "time_constant": 8.0},
        "current_limit": {"limit": 0.7},
        "backlash": {"width": 0.02, "stiffness": 2000.0, "damping": 8.0},
    }
    places = {"payload_mass": machine.contacts[0][0], "center_of_mass": machine.bodies[-1]}
    places |= {"joint_compliance": middle, "current_limit": first, "backlash": first}
    places |= dict.fromkeys(WHOLE_ROBOT, "robot")
    return Flaw(effect, places.get(effect, last), values[effect])


def test_the_closed_form_is_what_mujoco_computes() -> None:
    random = np.random.default_rng(1)
    machines = [draw_machine(random, "arm2") for _ in range(5)]
    q, v = random.uniform(-2.0, 2.0, (2, 5, 2))
    mass, bias = PlanarLinks(machines).terms(q, v)
    for k, machine in enumerate(machines):
        expected = Rigid(machine).mass_and_bias(q[k], v[k])
        np.testing.assert_allclose(mass[k], expected[0], rtol=1e-9)
        np.testing.assert_allclose(bias[k], expected[1], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("family", ["arm3", "wrist6", "biped", "flyer"])
def test_a_machine_without_flaws_leaves_nothing_but_noise(family: str) -> None:
    case = recorded(draw_machine(np.random.default_rng(3), family), (), ("multisine", "holds"))
    tables = record_cases([(case, case.excitations)])[0]
    # Without repeats the floor is a lower bound; a wrong equation would leave tens of floors.
    assert compare(robot_of(case), logs_of(tables)).error < 2.0


@pytest.mark.parametrize(
    ("family", "effect"),
    [
        ("arm3", effect)
        for effect in (*LISTED, *LATER)
        if effect not in ("current_limit", "backlash", *AT_MOTORS)
    ]
    + [("wrist6", effect) for effect in AT_MOTORS]
    + [("biped", effect) for effect in ("load_friction", "payload_mass", "gravity_direction")],
)
def test_the_librarys_effect_is_the_plants_on_a_prescribed_motion(
    family: str, effect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whether a column looks wrong is asked in closed loop, and takes two thirds of the time here.
    monkeypatch.setattr(estimation_problem, "suspicions", lambda *_: [])
    machine = draw_machine(np.random.default_rng(3), family)
    assert_told(recorded(machine, (flaw_of(effect, machine),), ("multisine", "sweep")))


def test_the_librarys_effects_are_the_plants_in_closed_loop() -> None:
    machine = draw_machine(np.random.default_rng(3), "pendulum")
    left_out = ("joint_compliance", "backlash", "supply_sag", *ONLY_PRESCRIBED, *AT_MOTORS)
    names = [e for e in (*LISTED, *LATER) if e not in left_out]
    cases = [recorded(machine, (flaw_of(name, machine),), ("multisine",)) for name in names]
    jobs = [(case, case.excitations) for case in cases]
    for case, tables in zip(cases, record_cases(jobs), strict=True):
        assert_told(case, tables)


def assert_told(case: Case, tables: list[dict[str, np.ndarray]] | None = None) -> None:
    """The robot with its flaw explains the logs that the robot as drawn does not."""
    logs = logs_of(tables or record_cases([(case, case.excitations)])[0])
    robot = robot_of(case)
    true = robot.with_effects(*(EFFECTS[f.effect].at(f.where, dict(f.values)) for f in case.flaws))
    error = {one.name: one.error for one in rank_robots({"drawn": robot, "true": true}, logs)}
    assert error["drawn"] > 1.5, case.label
    assert error["true"] < max(1.4, 0.06 * error["drawn"]), case.label
