"""In the plant: what the controller knows of its gears decides, and unknown loads are learned."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.random import default_rng

from sims.leg import balanced_pose, squat, stance_controller, stance_references
from sims.legged import CenterOfMass
from wbc import control
from wbc.control import DisturbanceObserver
from wbc.effects import PayloadMass, load_robot
from wbc.robot import Motion
from wbc.sim import Plant

LOSSY = load_robot("planar_leg_strong")
IDEAL = LOSSY.lossless()
ARM = replace(load_robot("planar_leg_fixed").lossless(), contacts=())
LOADED = ARM.with_effect(PayloadMass(ARM.bodies[-1], mass=1.0))
TARGET = ARM.configuration(hip=0.6, knee=0.5)


def squatted(machine, model, noise):
    """Return rms height error [m] and worst pitch [rad] of a squat, and whether all was solved."""
    plant, controller, generator = Plant(machine), stance_controller(model), default_rng(0)
    state, measured = plant.state(balanced_pose(machine)), CenterOfMass(machine)
    height = squat(float(measured(state)[2]), 0.025, 0.5)
    errors, pitch, usable = [], 0.0, True
    for tick in range(1600):
        wanted, v = height(1e-3 * tick), state.velocity + noise * generator.normal(size=5)
        command = controller.step(Motion(state.position, v), stance_references(wanted))
        usable = usable and command.status.usable
        state = plant.step(state, command.rotor_torque, 1e-3).state
        errors.append(measured(state)[2] - wanted[0])
        pitch = max(pitch, abs(state.position[2]))
    return np.sqrt(np.mean(np.square(errors))), pitch, usable


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_squat_on_lossy_gears_is_as_good_as_on_ideal_ones(noise):
    ideal, _, sound = squatted(IDEAL, IDEAL, noise)
    ours, pitch, usable = squatted(LOSSY, LOSSY, noise)
    blind, _, _ = squatted(LOSSY, IDEAL, noise)
    assert sound
    assert usable
    assert pitch < 0.3
    assert ours <= 1.05 * ideal
    assert blind >= 3.0 * ideal


def held(observer, machine=LOADED, ticks=2500, noise=0.0):
    """Return the last error [rad] of an arm that holds its pose, and what it learned by tick."""
    settings = control.ControllerSettings(disturbance=observer)
    controller = control.Controller(ARM, [control.PostureTask.of(ARM)], settings=settings)
    plant, generator, learned = Plant(machine), default_rng(0), []
    state = plant.state(TARGET)
    for _ in range(ticks):
        seen = Motion(state.position, state.velocity + noise * generator.normal(size=2))
        command = controller.step(seen, {"posture": control.Reference(TARGET)})
        assert command.status.usable
        state = plant.step(state, command.rotor_torque, 1e-3).state
        learned.append(controller.disturbance)
    return np.abs(state.position - TARGET).max(), np.array(learned)


def test_a_constant_load_is_learned():
    without, nothing = held(None)
    missed, learned = held(DisturbanceObserver(rate=4.0, bound=50.0))
    assert not nothing.any()
    assert without > 1e-3
    assert missed < 0.02 * without
    rest = np.zeros(ARM.model.nv)
    true, believed = (
        pin.rnea(r.model, r.model.createData(), TARGET, rest, rest).copy() for r in (LOADED, ARM)
    )
    np.testing.assert_allclose(learned[-1], believed - true, rtol=0.02, atol=0.02)
    jumps = np.abs(np.diff(learned, axis=0)).max()
    assert jumps < 0.05 * np.abs(learned[-1]).max()


def test_what_is_learned_keeps_its_bound():
    _, learned = held(DisturbanceObserver(rate=4.0, bound=0.5), ticks=800)
    assert np.abs(learned).max() == pytest.approx(0.5)


def test_noise_of_the_encoders_does_not_add_up():
    """What a velocity adds by its noise it takes away in the next tick."""
    _, learned = held(DisturbanceObserver(rate=2.0, bound=50.0), ARM, 600, noise=0.01)
    assert np.abs(learned[-1]).max() < 0.5
