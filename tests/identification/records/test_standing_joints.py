"""Logs that each move only some of the joints, as machines with brakes are recorded."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction, TorqueOffset, ViscousFriction, load_robot
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log, LogSource
from wbc.sim import Plane, Plant, SimState, simulate
from wbc.sim.excitation import ENCODER, MultiSine

LEG = load_robot("planar_leg_fixed").lossless()
RUBS = {"hip": 0.5, "knee": 0.3}
BRAKE = 200.0  # [N m]
SWAP = {"hip": "knee", "knee": "hip"}


def recorded(moving: str, seed: int, noise: int) -> Log:
    """Return a log of a leg that moves one joint while a brake holds the other."""
    levels = RUBS | {SWAP[moving]: BRAKE}
    real = LEG.with_effects(*(CoulombFriction(j, level=level) for j, level in levels.items()))
    path, gears = MultiSine(LEG, seed), LEG.transmission
    moves = np.array([joint == moving for joint in gears.joints])
    start = path.at(0.0)[0]
    plant = Plant(real, Plane(height=-10.0))

    def control(state: SimState) -> FloatArray:
        q, v, _ = path.at(state.time)
        # The drive of the braked joint is off.
        torque = 150.0 * (q - state.position) + 8.0 * (v - state.velocity)
        return np.asarray(moves * torque / gears.gear_ratio)

    log = simulate(plant, control, plant.state(start, 0.0 * start), 4.0, dt=1e-3).log
    return ENCODER.measure(real, log, noise).with_source(LogSource(path=f"{moving}{noise}.csv"))


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    return [recorded("hip", 20, 1), recorded("knee", 21, 2), recorded("hip", 20, 3)]


def test_logs_that_each_move_one_joint_tell_the_friction_of_both(logs: list[Log]) -> None:
    found = diagnose(LEG, logs, [CoulombFriction, ViscousFriction, TorqueOffset])
    assert found.verdict == "named"
    levels = {f.effect.where: f.parameters["level"] for f in found.findings}
    assert levels.keys() == RUBS.keys()
    for joint, level in RUBS.items():
        assert levels[joint].value == pytest.approx(level, rel=0.05)
    (warning,) = [text for text in found.warnings if "stand still" in text]
    assert "hip in knee2.csv; knee in hip1.csv, hip3.csv." in warning


def test_a_repeat_that_holds_a_joint_still_says_nothing_of_its_noise(logs: list[Log]) -> None:
    floor = EstimationProblem.from_logs(LEG, logs).floor
    assert floor.repeats == ((0, 2),)
    size = np.sqrt(np.diag(floor.sensors))
    assert floor.values[1] == pytest.approx(size[1])
    assert 0.5 * size[0] < floor.values[0] < 2.0 * size[0]


def test_a_channel_that_never_changes_is_no_crash(logs: list[Log]) -> None:
    hip, knee, _ = logs
    held = hip.with_columns(
        {
            "knee.position": np.full(len(hip), hip.column("knee.position")[0]),
            "knee.velocity": np.zeros(len(hip)),
            "knee.rotor_torque": np.zeros(len(hip)),
        }
    )
    found = diagnose(LEG, [held, knee], [CoulombFriction])
    assert {f.effect.where for f in found.findings} == {"hip", "knee"}
