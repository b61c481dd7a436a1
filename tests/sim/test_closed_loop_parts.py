"""What stands between controller and plant: noise, dead time, first-order lag."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from wbc import load_robot
from wbc.robot import Motion
from wbc.sim import ClosedLoop, Plane, Plant, SensorNoise, TorqueLag, simulate

LEG, AIR = load_robot("planar_leg_fixed"), Plane(height=-10.0)


class Damper:
    """A controller that needs no model."""

    def __init__(self):
        self.seen = []

    def step(self, state, references=None, contacts=None):
        self.seen.append(state)
        torque = 0.5 * np.cos(5.0 * state.position) - 0.01 * state.velocity
        return SimpleNamespace(rotor_torque=torque)


def played(loop, ticks=50):
    """Return the state after some ticks from the usual start."""
    state = loop.plant.state([0.3, 0.4])
    for _ in range(ticks):
        tick = loop.step(state)
        assert (tick.seen.position == loop.plant.encoders(state).position).all()
        state = tick.state
    return state


def test_with_nothing_between_it_is_the_plain_loop_to_the_last_bit():
    plant, control = Plant(LEG, AIR), Damper()
    start = plant.state([0.3, 0.4])
    state = simulate(plant, lambda s: control.step(s).rotor_torque, start, 0.05).state
    for lag in (None, TorqueLag()):
        for noise in (None, SensorNoise(LEG)):
            ours = played(ClosedLoop(Plant(LEG, AIR), Damper(), noise=noise, lag=lag))
            assert (ours.position == state.position).all()
            assert (ours.velocity == state.velocity).all()


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 2e-3, 2.7e-3])
@pytest.mark.parametrize("bandwidth", [np.inf, 50.0, 3e5])
def test_the_mean_torque_is_that_of_the_lag_in_small_steps(delay, bandwidth):
    """Truth: explicit integration of tau dy/dt = u(t - delay) - y in steps of 0.1 us."""
    sent, fine = np.random.default_rng(1).normal(size=8), 10_000
    lag, tau = TorqueLag(delay=delay, bandwidth=bandwidth), 1.0 / (2.0 * np.pi * bandwidth)
    got = np.array([lag(np.array([torque]), 1e-3)[0] for torque in sent])
    held = np.concatenate((np.full(round(delay * 1e7), sent[0]), np.repeat(sent, fine)))
    left = np.exp(-1e-7 / tau) if tau else 0.0
    heard = held[: len(sent) * fine]
    ends = lfilter([1.0 - left], [1.0, -left], heard, zi=[left * sent[0]])[0]
    starts = np.concatenate(([sent[0]], ends[:-1]))
    path = 0.5 * (starts + ends) if tau else ends
    np.testing.assert_allclose(got, path.reshape(-1, fine).mean(axis=1), atol=1e-5)


def test_noise_has_its_deviation_and_keeps_orientations():
    robot = load_robot("solo12")
    noise = SensorNoise(robot, position=1e-3, velocity=0.05, seed=4)
    state = Motion(robot.pose(), np.zeros(robot.model.nv))
    seen = [noise(state) for _ in range(2000)]
    speeds, places = (
        np.array(x) for x in zip(*((one.velocity, one.position) for one in seen), strict=True)
    )
    assert speeds.std(axis=0) == pytest.approx(0.05, rel=0.1)
    assert places[:, 7:].std(axis=0) == pytest.approx(1e-3, rel=0.1)
    assert np.abs(places[:, 7:].mean(axis=0) - state.position[7:]).max() < 2e-4
    assert np.abs(np.linalg.norm(places[:, 3:7], axis=1) - 1.0).max() < 1e-12
    assert 2.0 * places[:, 3:6].std(axis=0) == pytest.approx(1e-3, rel=0.1)


def test_reset_starts_anew():
    parts = {"noise": SensorNoise(LEG, velocity=0.05), "lag": TorqueLag(delay=2e-3)}
    loop, ends = ClosedLoop(Plant(LEG, AIR), Damper(), **parts), []
    for _ in range(2):
        loop.reset()
        ends.append(played(loop, 5).velocity)
    assert (ends[0] == ends[1]).all()


def test_controllers_see_the_encoders_of_loose_gears():
    """A gear with play: the joint hangs in it, the encoder shows the motor."""
    loose = LEG.with_transmission(LEG.transmission.replace(backlash=np.array([0.2, 0.0])))
    control = Damper()
    state = played(ClosedLoop(Plant(loose, AIR), control), 40)
    assert abs(control.seen[-1].position[0] - state.position[0]) > 1e-3
