"""Recordings are logs, sensors are seeded, effects act through their hooks alone."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot, sim
from wbc.effects import JointCompliance
from wbc.view import write_playback


@cache
def _run() -> sim.Simulation:
    robot = load_robot("planar_leg")
    plant, q = sim.Plant(robot), robot.configuration(hip=0.5, knee=-1.0)
    q[1] = 0.8 * np.cos(0.5) + 0.01
    return sim.simulate(plant, lambda s: np.array([-0.1, 0.2]), plant.state(q), 0.2)


def test_the_playback_shows_what_steps_had_to_say(tmp_path: Path) -> None:
    """Events of one kind in a row are one mark, where they begin."""
    run = _run()
    seen = ("overlap", 0.02), ("overlap", 0.021), ("overlap", 0.1), ("energy", 0.05)
    events = tuple(sim.StepEvent(kind, time, 1.0, f"{kind} of {time}") for kind, time in seen)
    marks = replace(run, events=events).marks
    assert marks == {
        "overlap: overlap of 0.02": 0.02,
        "overlap: overlap of 0.1": 0.1,
        "energy: energy of 0.05": 0.05,
    }
    page = write_playback(tmp_path / "run.html", load_robot("planar_leg"), run.log, marks=marks)
    text = page.read_text(encoding="utf-8")
    assert all(label in text for label in marks)


def test_a_recording_is_a_log_of_true_values() -> None:
    run, log = _run(), _run().log
    assert len(log) == 200
    assert log.joints == ("base_x", "base_z", "base_pitch", "hip", "knee")
    assert np.all(log.column("hip.rotor_torque") == -0.1)
    assert log.column("foot.force.z").max() > 100.0
    assert np.all(log.column("foot.force.z") >= 0.0)
    # Moreau's scheme: displacement is the mean of the two speeds.
    q, v = log.column("knee.position"), log.column("knee.velocity")
    smooth = log.column("foot.force.z")[:-1] == 0.0
    assert np.allclose(np.diff(q)[smooth], 5e-4 * (v[1:] + v[:-1])[smooth], atol=1e-12)
    assert run.unsettled == 0
    assert str(run.audit).count("J") >= 10


def test_the_audit_counts_the_heat_of_windings_that_are_known() -> None:
    """A constant torque heats by R (tau / k_t)^2, whatever moves."""
    known = load_robot("planar_leg_strong")
    gears, torque = known.transmission, np.array([1.5, -2.5])
    plant = sim.Plant(known)
    audit = sim.simulate(plant, lambda _: torque, plant.state(known.pose()), 0.05).audit
    heat = 0.05 * np.sum(gears.resistance * (torque / gears.torque_constant) ** 2)
    assert audit.joule_heat == pytest.approx(heat, rel=1e-12)
    assert audit.electric == pytest.approx(audit.flow.motor + heat)
    assert str(audit).splitlines()[-1] == f"{'beside: Joule heat':24s}{heat:14.6f} J"
    unknown = _run().audit
    assert np.isnan(unknown.joule_heat)
    assert "Joule" not in str(unknown)


def test_sensors_are_seeded_and_do_what_they_say() -> None:
    robot = load_robot("planar_leg")
    log = _run().log
    model = sim.SensorModel(
        position=sim.Sensor(resolution=1e-3),
        velocity=sim.Sensor(noise=0.01, bias=0.5),
        force=sim.Sensor(delay=0.01),
        every=2,
    )
    one, same, other = (model.measure(robot, log, seed) for seed in (1, 1, 2))
    assert len(one) == 100
    for name in one.names:
        assert np.array_equal(one.column(name), same.column(name))
    assert not np.array_equal(one.column("hip.velocity"), other.column("hip.velocity"))
    steps = one.column("hip.position") / 1e-3
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    error = one.column("hip.velocity") - log.column("hip.velocity")[::2]
    assert error.mean() == pytest.approx(0.5, abs=0.005)
    assert error.std() == pytest.approx(0.01, rel=0.3)
    late = np.interp(one.time - 0.01, log.time, log.column("foot.force.z"))
    assert np.allclose(one.column("foot.force.z"), late)


def test_encoders_on_the_motors_see_the_gear_wind_up() -> None:
    """A gear held still under gravity: the encoder stays, the link sags by load over stiffness."""
    robot = load_robot("planar_leg_fixed").lossless()
    soft = robot.with_effect(JointCompliance("knee", stiffness=200.0, damping=3.0))
    plant, q = sim.Plant(soft, sim.Plane(height=-10.0)), np.array([0.0, 1.0])

    def held(state: sim.SimState) -> np.ndarray:
        seen = plant.encoders(state)
        return (300.0 * (q - seen.position) - 10.0 * seen.velocity) / 20.0

    log = sim.simulate(plant, held, plant.state(q), 3.0).log
    shown = sim.SensorModel().measure(soft, log, seed=0)
    assert not shown.has("knee.rotor_position")
    link, motor = log.column("knee.position")[-1], shown.column("knee.position")[-1]
    load = log.column("knee.joint_torque")[-1]
    assert motor - link == pytest.approx(load / 200.0, rel=1e-4)
    assert abs(motor - link) > 0.01
    assert motor == pytest.approx(log.column("knee.rotor_position")[-1] / 20.0, abs=1e-12)
    np.testing.assert_allclose(shown.column("hip.position"), log.column("hip.position"), atol=1e-12)
