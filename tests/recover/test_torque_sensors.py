"""A torque sensor behind a gear: what is wrong before it and behind it, told apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.outside import ROOT
from wbc import load_robot
from wbc.effects import EFFECTS, PayloadMass, TransmissionEfficiency
from wbc.errors import LogError
from wbc.identification import compare, diagnose
from wbc.identification.classic import ClassicFit, identify, link_names
from wbc.identification.formulas import discover
from wbc.identification.readings import check_logs
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.sim import Sensor
from wbc.sim.excitation import ENCODER, record_run
from wbc.transmission import mesh_input

LEG = load_robot("planar_leg_fixed").lossless()
SENSING = replace(ENCODER, joint_torque=Sensor(noise=0.02, delay=0.5e-3))
LOSSY = TransmissionEfficiency("knee", 0.8, 0.72)
HEAVY = PayloadMass("shin", 0.15)
NAMES = """transmission_efficiency payload_mass center_of_mass coulomb_friction viscous_friction
rotor_coulomb_friction rotor_viscous_friction torque_constant load_friction rotor_inertia"""
KINDS = [EFFECTS[name] for name in NAMES.split()]


@pytest.fixture(scope="module")
def sensed() -> list[Log]:
    """Return two logs of a leg with a heavy shin and a lossy knee, sensors behind both gears."""
    real = LEG.with_effects(LOSSY, HEAVY)
    runs = [record_run(real, LEG, seed, 4.0) for seed in (7, 8)]
    return [SENSING.measure(real, run, k) for k, run in enumerate(runs)]


def blind(logs: list[Log]) -> list[Log]:
    return [log.select(n for n in log.names if "joint_torque" not in n) for log in logs]


def test_a_wrong_mass_and_a_lossy_gear_are_named_each_on_its_side(sensed: list[Log]) -> None:
    with_sensor, without = (diagnose(LEG, logs, KINDS) for logs in (sensed, blind(sensed)))
    assert with_sensor.verdict == "named"
    findings = {f.effect.key: f for f in with_sensor.findings}
    assert findings.keys() == {LOSSY.key, HEAVY.key}
    for truth in (LOSSY, HEAVY):
        found = findings[truth.key]
        assert found.probability > 0.95
        for name, value in truth.values.items():
            assert found.parameters[name].value == pytest.approx(value, rel=0.01)
    # A sensor tells the mass better.
    (other,) = (f for f in without.findings if f.effect.key == HEAVY.key)
    seen, unseen = (f.parameters["mass"] for f in (findings[HEAVY.key], other))
    assert seen.high - seen.low < 0.8 * (unseen.high - unseen.low)
    names = [output.output for output in with_sensor.outputs]
    assert names == ["hip", "knee", "hip (link side)", "knee (link side)"]


def test_the_classic_fit_reads_the_links_from_the_sensor(sensed: list[Log]) -> None:
    with_sensor, without = identify(LEG, sensed), identify(LEG, blind(sensed))
    assert with_sensor.joints == ("hip", "knee", "hip (link side)", "knee (link side)")

    robots = LEG, LEG.with_effects(HEAVY)
    moments = [value for robot in robots for n, _, value in link_names(robot) if n == "mz shin"]

    def off(fit: ClassicFit) -> float:
        """Return how far the shin's greatest moment is from the truth, as a share."""
        (found,) = [p for p in fit.parameters if p.name == "mz shin"]
        return abs((found.value - found.given) / (moments[1] - moments[0]) - 1.0)

    # The knee's gear loses a fifth, and a fit of perfect gears puts a part of it into the shin.
    assert off(with_sensor) < 0.01
    assert off(without) > 0.05
    assert np.all(with_sensor.left[2:] < 0.1)


def test_dry_friction_is_told_by_its_side_of_the_sensor() -> None:
    for name in ("coulomb_friction", "rotor_coulomb_friction"):
        hidden = EFFECTS[name].at("hip", {"level": 0.4})
        real = LEG.with_effects(hidden)
        logs = [SENSING.measure(real, record_run(real, LEG, k, 3.0), k) for k in (7, 8)]
        assert [f.effect.key for f in diagnose(LEG, logs, KINDS).findings] == [hidden.key]


def test_a_formula_behind_the_sensor_knows_nothing_of_the_gear(sensed: list[Log]) -> None:
    with_sensor, loss = discover(LEG, sensed), "|load_knee| * sign(v_knee)"
    terms = {p.effect.where: set(p.coefficients) for p in with_sensor.proposals}
    # The heavy shin hangs behind the sensor, the loss of the knee's gear is before it.
    assert terms["knee"]
    assert loss not in terms["knee"]
    assert "between motor and torque sensor" in with_sensor.remainder
    assert "at knee" in with_sensor.remainder
    assert with_sensor.outcome == "partial"


SENSOR_ONLY = """
model = "{model}"
lock = ["base_x", "base_z", "base_pitch"]
[gears."*"]
torque_sensor = true
"""


def only_sensing(folder: Path) -> Robot:
    model = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
    (folder / "robot.toml").write_text(SENSOR_ONLY.format(model=model))
    return load_robot(folder / "robot.toml")


def without_drives(logs: list[Log]) -> list[Log]:
    return [log.select(n for n in log.names if "rotor_torque" not in n) for log in logs]


def test_a_robot_that_only_has_the_sensor_needs_no_ratio(sensed: list[Log], tmp_path: Path) -> None:
    robot, logs = only_sensing(tmp_path), without_drives(sensed)
    found = diagnose(robot, logs, KINDS)
    assert [f.effect.key for f in found.findings] == [HEAVY.key]
    assert found.findings[0].parameters["mass"].value == pytest.approx(0.15, rel=0.01)
    assert not any("torque constant" in text for text in found.warnings)
    with pytest.raises(LogError, match=r"hip\.joint_torque, .* needed"):
        diagnose(robot, blind(logs))
    # The check says so first, also where the drive reports something.
    drives = [log.select(n for n in log.names if "joint_torque" not in n) for log in sensed]
    for quality in check_logs(drives, robot):
        assert ["hip.joint_torque" in f.text for f in quality.of_kind("no_torque")] == [True]


def test_the_zero_of_a_sensor_that_reports_alone_is_found(
    sensed: list[Log], tmp_path: Path
) -> None:
    """A recorded arm with zeros of 0.3 to 0.8 N m kept up to its first error, without a word."""
    name, logs = "hip.joint_torque", without_drives(sensed)
    off = [log.with_columns({name: log.column(name) + 0.3}) for log in logs]
    robot, kinds = only_sensing(tmp_path), [*KINDS, EFFECTS["torque_offset"]]
    found = {f.effect.key: f for f in diagnose(robot, off, kinds).findings}
    assert found.keys() == {HEAVY.key, ("torque_offset", "hip")}
    zero = found["torque_offset", "hip"]
    assert zero.certain
    assert zero.effect.values["offset"] == pytest.approx(-0.3, abs=0.01)
    # Nothing is told of drives that report nothing, nor of gears that nobody knows.
    assert [output.output for output in compare(robot, off).outputs] == ["hip", "knee"]
    assert EFFECTS["rotor_inertia"].places(robot) == ()


def test_drives_that_report_nothing_are_not_told_of(sensed: list[Log]) -> None:
    """Beside a described gear a sensor alone made "measured 0" of the row of the drive."""
    outputs = compare(LEG, without_drives(sensed)).outputs
    assert [output.output for output in outputs] == ["hip (link side)", "knee (link side)"]


BENCH = """
model = "bench.urdf"
[gears.test]
gear_ratio = { value = 50.0, unit = "1" }
rotor_inertia = { value = 2e-5, unit = "kg m^2" }
[gears.brake]
gear_ratio = { value = 1.0, unit = "1" }
rotor_inertia = { value = 3e-3, unit = "kg m^2" }
"""


def without_positions(log: Log) -> Log:
    return log.select(n for n in log.names if not n.endswith(".position"))


URDF = '<robot name="bench"><link name="world"/>' + "".join(
    f'''<link name="{name}s"/><joint name="{name}" type="revolute"><parent link="world"/>
    <child link="{name}s"/><axis xyz="1 0 0"/>
    <limit lower="-1000" upper="1000" effort="100" velocity="100"/></joint>'''
    for name in ("test", "brake")
)


def bench_log(seed: int) -> Log:
    """Return a run of two motors on one shaft, speed and load waves of their own (closed form)."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 8.0, 0.004)
    phase = random.uniform(0.0, 6.0, 4)
    rates, sizes = np.array([1.3, 3.1]), np.array([3.0, 2.0])
    wave = np.outer(time, rates) + phase[:2]
    angle, speed = -np.cos(wave) @ (sizes / rates), np.sin(wave) @ sizes
    change = np.cos(wave) @ (sizes * rates)
    shaft = np.sin(np.outer(time, [2.2, 0.7]) + phase[2:]) @ [6.0, 4.0]
    forward, backward = np.array([0.8]), np.array([0.7])
    mesh = mesh_input(shaft[:, None], speed[:, None], forward, backward)[:, 0]
    motor = mesh + 50.0**2 * 2e-5 * change + 0.3 * np.sign(speed)  # dry friction of the rotor
    columns = {}
    for name, turn, drive in (("test", 1.0, motor), ("brake", -1.0, -shaft + 3e-3 * change)):
        for quantity, values, noise in (
            ("position", angle, 2e-5),
            ("velocity", speed, 1e-3),
            ("motor_torque", drive, 0.02),
            ("joint_torque", turn * shaft, 0.02),
        ):
            columns[f"{name}.{quantity}"] = values + noise * random.standard_normal(time.size)
    return Log(time, columns)


def test_a_dynamometer_gives_efficiencies_and_friction_in_both_directions(tmp_path: Path) -> None:
    (tmp_path / "bench.urdf").write_text(URDF + "</robot>")
    (tmp_path / "robot.toml").write_text(BENCH)
    assert len(BENCH.strip().splitlines()) <= 10
    robot = load_robot(tmp_path / "robot.toml")
    with_angles = [bench_log(k) for k in (1, 2)]
    logs = [without_positions(log) for log in with_angles]
    assert all(quality.usable for quality in check_logs(logs, robot))
    numbers = {f.effect.key: f.effect.values for f in diagnose(robot, logs, KINDS).findings}
    gear, rotor = ("transmission_efficiency", "test"), ("rotor_coulomb_friction", "test")
    assert numbers.keys() == {gear, rotor}
    assert numbers[gear]["forward_efficiency"] == pytest.approx(0.8, abs=0.005)
    assert numbers[gear]["backward_efficiency"] == pytest.approx(0.7, abs=0.005)
    assert numbers[rotor]["level"] == pytest.approx(0.3, abs=0.02)
    # A bench is judged alike with its angles. What stands behind a shaft without links is not
    # described, and not said to be wrong.
    without = compare(robot, logs).outputs
    assert [output.output for output in without] == ["test", "brake"]
    for one, other in zip(compare(robot, with_angles).outputs, without, strict=True):
        assert other.rms == pytest.approx(one.rms, rel=0.02)
        assert other.floor == pytest.approx(one.floor, rel=0.1)


def test_a_velocity_is_not_enough_where_gravity_acts(sensed: list[Log]) -> None:
    poor = without_positions(sensed[0])
    (finding,) = check_logs([poor], LEG)[0].of_kind("joints_unknown")
    assert "velocity of hip, knee alone is not enough" in finding.text + finding.way_out
    with pytest.raises(LogError, match="depends on the position"):
        compare(LEG, [poor])
