"""A wrong drawing must be named as that: not shifted centres, payloads or torque constants.

The logs are those of generated six-axis arms, by MuJoCo; the robot that is given has wrong
inertias. What could imitate them is on offer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import draw_machine
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.machine import Link, Machine
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.sensors import Sensors
from benchmarks.corpus.signature import Signatures
from benchmarks.corpus.trial import logs_of, robot_of
from tests.moved import moved
from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.dynamics import inertial_parameters
from wbc.effects import EFFECTS, LinkInertia
from wbc.identification import Diagnosis, diagnose
from wbc.measurement import Log
from wbc.robot import Evidence, Robot

LINKS = "payload_mass link_inertia link_inertias center_of_mass"
DRIVES = "viscous_friction coulomb_friction rotor_inertia torque_constant"
CANDIDATES = [EFFECTS[n] for n in f"{LINKS} {DRIVES} position_offset gravity_direction".split()]
RUNS = ("multisine", "fast")


def misdrawn(link: Link, random: np.random.Generator, size: float) -> Link:
    """Return a link as a drawing has it that is off by about `size` in everything."""
    mass = link.mass * np.exp(size * random.normal())
    com = link.com + 0.5 * size * np.linalg.norm(link.com) * random.normal(size=3)
    second = 0.5 * np.trace(link.inertia) * np.eye(3) - link.inertia
    stretch = np.eye(3) + size * random.normal(size=(3, 3))
    second = stretch @ second @ stretch.T * mass / link.mass
    return replace(link, mass=mass, com=com, inertia=np.trace(second) * np.eye(3) - second)


def arm(
    seed: int, links: Sequence[int], size: float, flaws: Sequence[Flaw] = ()
) -> tuple[Robot, list[Log], Machine]:
    """Return a robot whose drawing is wrong, logs of the true one, and the true one."""
    random = np.random.default_rng(seed)
    true = drawn = draw_machine(random, "arm6")
    sensors = Sensors(rate=250.0, position=3e-5, bits=16, velocity=3e-3, torque=0.005, force=0.5)
    seeds = 100 * seed, 100 * seed + 1
    runs = tuple(Excitation(kind, s, 4.0, s) for kind, s in zip(RUNS, seeds, strict=True))
    for k in links:
        drawn = drawn.with_link(k, misdrawn(true.links[k], random, size))
    noise = Signatures(true, runs, sensors).torque_noise
    case = Case(0, true, tuple(flaws), runs, "fair", sensors, noise)
    return robot_of(replace(case, machine=drawn)), logs_of(record_cases([(case, runs)])[0]), true


def found(diagnosis: Diagnosis) -> set[tuple[str, str]]:
    return {(effect.name, effect.where) for effect in diagnosis.effects}


def test_one_wrong_link_is_named_with_its_numbers_and_nothing_else() -> None:
    robot, logs, true = arm(3, [2], 0.2)
    diagnosis = diagnose(robot, logs, CANDIDATES)
    assert diagnosis.verdict == "named"
    assert found(diagnosis) == {("link_inertia", "l3")}
    (finding,) = diagnosis.findings
    assert finding.probability > 0.9
    link = true.links[2]
    moments = np.linalg.eigvalsh(link.inertia)
    truth = {"mass": link.mass} | {f"center_{x}": c for x, c in zip("xyz", link.com, strict=True)}
    truth |= {f"principal_inertia_{k}": value for k, value in enumerate(moments, start=1)}
    told = finding.quantities
    assert {"mass", "center_x", "center_y"} <= told.keys()
    inside = [e.low <= truth[name] <= e.high for name, e in told.items() if name in truth]
    assert np.mean(inside) >= 0.8
    assert told["mass"].value == pytest.approx(link.mass, rel=0.01)
    joint = robot.body_joint("l3")
    assert told["mass"].given == pytest.approx(robot.model.inertias[joint].mass)
    # Physical by construction: some distribution of positive mass has this inertia.
    smallest, middle, largest = np.linalg.eigvalsh(diagnosis.robot.model.inertias[joint].inertia)
    assert 0.0 < smallest <= middle <= largest <= smallest + middle


def test_a_drawing_that_is_off_everywhere_is_one_cause() -> None:
    robot, logs, _ = arm(4, range(6), 0.04)
    diagnosis = diagnose(robot, logs, CANDIDATES)
    assert diagnosis.verdict == "named"
    assert found(diagnosis) == {("link_inertias", "robot")}
    assert diagnosis.findings[0].probability > 0.9
    warnings = diagnosis.findings[0].warnings
    assert any("these logs tell" in warning for warning in warnings)


def test_a_tool_nine_times_as_heavy_as_its_link_is_within_reach_of_a_linear_screen() -> None:
    robot = load_robot("planar_leg_fixed")
    (screen,) = LinkInertia.search.screens(LinkInertia, robot, "shin", Evidence((), (), ()))

    def shin(values: Mapping[str, float]) -> FloatArray:
        return inertial_parameters(LinkInertia.at("shin", values).change(robot))[10:]

    drawn, tool = shin({}), pin.Inertia(18.0, np.array([0.1, 0.02, -0.3]), 0.1 * np.eye(3))
    slopes = np.transpose([shin(unit) - drawn for unit in screen.units])
    steps = np.linalg.solve(slopes, tool.toDynamicParameters())
    reached = shin(screen.combine(steps)) - drawn
    assert reached == pytest.approx(tool.toDynamicParameters(), rel=1e-2, abs=1e-3)
    # Somebody mounts it: only what is drawn and is not there makes a drawing less likely.
    mounted = LinkInertia.at("shin", screen.combine(steps))
    assert LinkInertia.search.implausibility(mounted, robot, ()) == pytest.approx(0.0, abs=1e-6)
    lost = {name: -value for name, value in mounted.values.items() if name == "alpha"}
    assert LinkInertia.search.implausibility(LinkInertia.at("shin", lost), robot, ()) > 3.0


def test_a_payload_stays_a_payload() -> None:
    robot, logs, _ = arm(5, [], 0.0, [Flaw("payload_mass", "l3", {"mass": 0.4})])
    diagnosis = diagnose(robot, logs, CANDIDATES[:4])
    assert diagnosis.verdict == "named"
    assert found(diagnosis) == {("payload_mass", "l3")}
    assert diagnosis.findings[0].probability > 0.9


def test_a_tool_that_is_drawn_and_not_mounted_is_said_to_be_missing() -> None:
    _, logs, true = arm(6, [], 0.0)
    tool = true.links[5].with_point(1.5 * true.links[5].mass, np.array([0.02, 0.0, 0.1]))
    drawn = robot_of(Case(0, true.with_link(5, tool), (), (), "fair", None, None))  # type: ignore[arg-type]
    diagnosis = diagnose(drawn, logs, CANDIDATES[:4])
    assert found(diagnosis) == {("link_inertia", "l6")}
    assert any("are not there" in warning for warning in diagnosis.findings[0].warnings)


def test_a_tool_many_times_as_heavy_as_its_flange_is_found() -> None:
    """2.8 kg on 0.2 kg were out of reach, and went into the link before; 12,700 nats were asked."""
    robot = load_robot("staubli_tx40").lossless()
    joint = robot.model.getJointId("joint_6")
    flange, center = robot.model.inertias[joint], np.array([0.03, 0.15, 0.16])
    tool = pin.Inertia(2.8, center, pin.Inertia.FromSphere(2.8, 0.05).inertia)
    waves = np.random.default_rng(0).uniform((0.05, 0.5, 0.0), (0.3, 4.0, 6.0), (2, 6, 3, 3))
    true, time = robot.with_inertia(joint, flange + tool), np.arange(0.0, 8.0, 0.004)
    logs = [moved(true, time, own, seed=k) for k, own in enumerate(waves)]
    (finding,) = diagnose(robot, logs, [EFFECTS[name] for name in LINKS.split()]).findings
    assert finding.effect.key == ("link_inertia", "link_6")
    assert finding.certain
    assert finding.quantities["mass"].value == pytest.approx(flange.mass + 2.8, rel=0.02)
    center = (flange + tool).lever
    for axis, place in zip("xyz", center, strict=True):
        assert finding.quantities[f"center_{axis}"].value == pytest.approx(place, abs=3e-3)
