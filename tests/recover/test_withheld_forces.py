"""Legs whose feet have no force sensors: what is still found, and what is said not to be seen."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of, without_forces
from tests.benchmarks.test_corpus import case_of
from tests.moved import waving
from wbc import Robot, load_robot
from wbc.dynamics import contact_torque
from wbc.effects import EFFECTS, PayloadMass, PositionOffset
from wbc.identification import compare, diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import raw_residual
from wbc.identification.records.preparation import prepare
from wbc.measurement import Log

NAMES = """transmission_efficiency load_friction coulomb_friction viscous_friction torque_constant
torque_offset rotor_inertia payload_mass center_of_mass"""
KINDS = [EFFECTS[name] for name in NAMES.split()]
KNEE = {"forward_efficiency": 0.8, "backward_efficiency": 0.72}


def biped_with(*flaws: Flaw, kinds: tuple[str, ...] = ("multisine",)) -> tuple[Robot, list[Log]]:
    """Return two planar legs that stand, with these flaws, as a plant of its own moves them."""
    case = case_of(*flaws, kinds=kinds, family="biped")
    return robot_of(case), logs_of(record_cases([(case, case.excitations)])[0])


Biped = tuple[Robot, list[Log]]


@pytest.fixture(scope="module")
def biped() -> Biped:
    """Return two legs with a lossy knee."""
    return biped_with(Flaw("transmission_efficiency", "knee_f", KNEE), kinds=("multisine", "fast"))


def test_the_losses_of_a_knee_are_named_without_force_sensors(biped: Biped) -> None:
    robot, logs = biped
    withheld = [without_forces(log) for log in logs]
    assert not any(log.contacts for log in withheld)
    found = diagnose(robot, withheld, KINDS)
    knee = {f.effect.key: f for f in found.findings}["transmission_efficiency", "knee_f"]
    assert knee.probability > 0.95
    for name, truth in KNEE.items():
        assert knee.parameters[name].value == pytest.approx(truth, abs=0.01)
    # The balance leaves nothing of the base: a row of rounding made all probabilities NaN.
    assert all(0.0 <= f.probability <= 1.0 for f in found.findings)
    said = " ".join(found.warnings)
    assert "no force was measured at foot_f, foot_h" in said
    assert "base_z" in said


def test_a_robot_that_stands_needs_no_flags(biped: Biped) -> None:
    robot, logs = biped
    with_flags, bare = ([without_forces(log, flags=f) for log in logs] for f in (True, False))
    assert compare(robot, bare).error == pytest.approx(compare(robot, with_flags).error)


@pytest.mark.parametrize(("feet", "sensors"), [(1, 0), (2, 0), (3, 0), (4, 0), (4, 5), (2, 12)])
def test_no_force_at_an_active_foot_changes_what_is_judged(feet: int, sensors: int) -> None:
    """Whatever pushes at feet that touch, a quadruped leaves the same in its rows.

    Also with torque sensors behind some or all of its gears.
    """
    robot = load_robot("solo12").lossless()
    gears = robot.transmission
    robot = robot.with_torque_sensors(gears.joints[:sensors])
    names, log = tuple(contact.name for contact in robot.contacts[:feet]), waving(robot)
    log = log.select(name for name in log.names if "force" not in name)
    log = log.with_columns({f"{name}.active": np.ones(len(log)) for name in names})
    log = log.with_columns({f"{j}.joint_torque": np.zeros(len(log)) for j in robot.torque_sensors})
    record = prepare(robot, [log])[0]
    before = raw_residual(robot, record)
    random = np.random.default_rng(feet)
    forces = {n: 50.0 * random.standard_normal((len(before), 3)) for n in names}
    pushed = contact_torque(robot, record.motion.position, forces)
    carried = -(pushed[:, robot.actuated] @ gears.topology) / gears.gear_ratio
    behind = (carried * gears.gear_ratio)[:, robot.sensed]
    torques = {"torque": record.torque + carried, "sensed": record.sensed + behind}
    moved = replace(record.believing(robot), **torques)
    # What the base needs holds the forces, too, as if it had moved under them.
    links = record.links.copy()
    links[:, robot.unactuated] += pushed[:, robot.unactuated]
    moved.__dict__["links"] = links
    np.testing.assert_allclose(raw_residual(robot, moved), before, atol=1e-9)
    assert np.abs(carried * gears.gear_ratio).max() > 1.0
    assert np.abs(before).max() > 0.1  # gravity and inertia are not all hidden


def test_rows_near_a_change_of_a_flag_are_not_judged(biped: Biped) -> None:
    robot, logs = biped
    log = without_forces(logs[0], flags=True)
    lifted = np.where(log.time < log.time[len(log) // 2], 1.0, 0.0)
    record = prepare(robot, [log.with_columns({"foot_h.active": lifted})])[0]
    change = int(np.flatnonzero(np.diff(record.active["foot_h"].astype(int)))[0])
    assert np.all(record.weight[change - 2 : change + 2] == 0.0)
    assert replace(record, active={}).balance is None


def test_feet_that_hold_contradict_a_wrong_zero_that_is_not_there() -> None:
    def problem(*flaw: Flaw) -> EstimationProblem:
        robot, logs = biped_with(*flaw)
        return EstimationProblem.from_logs(robot, [without_forces(log) for log in logs])

    zero = PositionOffset("hip_f", offset=0.01)
    heavy = problem(Flaw("payload_mass", "shin_f", {"mass": 0.3}))
    # The zero explains a part of what the mass asks of the motors, and would move the foot.
    assert heavy.held_contacts(heavy.fit([zero])) < -30.0
    assert heavy.held_contacts(heavy.fit([PayloadMass("shin_f", mass=0.1)])) == 0.0
    wrong = problem(Flaw("position_offset", "hip_f", {"offset": 0.03}))
    fit = wrong.fit([zero])
    assert fit.effects[0].values["offset"] == pytest.approx(0.03, abs=0.003)
    assert wrong.held_contacts(fit) > 30.0
