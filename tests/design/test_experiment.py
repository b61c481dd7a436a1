"""Motions that decide: the odds said before against odds of simulated measurements."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize_scalar

from tests.design.rivals import LEG, LIMITS, rivals
from wbc.design.experiment import (
    FourierPath,
    MotionLimits,
    Rivals,
    deciding,
    design_experiment,
    expected,
    informing,
    random_paths,
)
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import load_robot
from wbc.errors import DesignError, EffectError
from wbc.robot import Motion, Robot
from wbc.transmission import Transmission

FRICTION = rivals("viscous_friction@knee:coefficient=0.3", "coulomb_friction@knee:level=0.5")


def path() -> FourierPath:
    return next(random_paths(FRICTION, LIMITS, 4.0, 3, 1))


def test_the_odds_are_those_of_simulated_measurements() -> None:
    """Fit both causes to noisy torques of the true one: the mean log-odds is what was said."""
    chosen, one = replace(FRICTION, noise=np.full(2, 0.05), band=np.inf), path()
    said = expected(chosen, LIMITS, one, rate=100.0).odds
    motion = Motion(*one.at(one.times(100.0)))
    links, random = link_torque(LEG, motion), np.random.default_rng(0)

    def torque(i: int, value: float) -> np.ndarray:
        (effect,) = chosen.causes[i]
        (name,) = effect.values
        robot = LEG.with_effect(effect.with_values({name: value}))
        return rotor_torque(robot, motion, links)[0]

    def least(i: int, measured: np.ndarray) -> float:
        def misfit(value: float) -> float:
            return 0.5 * np.sum(((torque(i, value) - measured) / 0.05) ** 2)

        return minimize_scalar(misfit, bounds=(0.0, 5.0), method="bounded").fun

    values = [next(iter(effect.values.values())) for (effect,) in chosen.causes]
    for true, other in ((0, 1), (1, 0)):
        clean, odds = torque(true, values[true]), []
        for _ in range(60):
            measured = clean + 0.05 * random.standard_normal(clean.shape)
            odds.append(least(other, measured) - least(true, measured))
        # Equal numbers of fitted parameters: what the noise gives to both fits cancels.
        error = np.std(odds) / np.sqrt(len(odds))
        assert np.mean(odds) == pytest.approx(said[true, other], abs=4.0 * error + 0.5)
        assert said[true, other] > 3.0


def test_the_designed_motion_beats_chance() -> None:
    chosen = rivals("rotor_inertia@knee", "payload_mass@shin")
    chance = [expected(chosen, LIMITS, p).worst for p in random_paths(chosen, LIMITS, 4.0, 1, 9)]
    classic = design_experiment(chosen, LIMITS, 4.0, rounds=24, aim=informing)
    ours = design_experiment(chosen, LIMITS, 4.0, rounds=24, starts=[classic.path])
    assert ours.worst > 5.0 * np.median(chance)
    assert ours.worst >= 0.99 * classic.worst  # compared at half the rate of the log
    again = design_experiment(chosen, LIMITS, 4.0, rounds=24, starts=[classic.path])
    np.testing.assert_array_equal(again.path.sine, ours.path.sine)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (("viscous@knee",), "Unknown effect"),
        (("viscous_friction@ankle",), "hip, knee"),
        (("viscous_friction@knee:level=1",), "coefficient"),
        (("viscous_friction@knee", "viscous_friction@knee"), "given twice"),
    ],
)
def test_what_cannot_be_compared_is_named(texts: tuple[str, ...], message: str) -> None:
    with pytest.raises((EffectError, DesignError), match=message):
        rivals(*texts)


def test_a_free_base_is_held_and_the_leg_is_then_the_fixed_leg() -> None:
    """The wrench of the stand reaches no gear: same motion, same odds as with a fixed base."""
    free = load_robot("planar_leg").lossless()
    texts = ("rotor_inertia@knee", "payload_mass@shin")
    chosen = (rivals(*texts, robot=robot) for robot in (free, LEG))
    odds, known = (expected(both, LIMITS, path()).odds for both in chosen)
    assert odds == pytest.approx(known, rel=1e-6)


def test_a_joint_without_a_gear_behind_a_driven_one_is_refused() -> None:
    model = pin.Model()
    for name in ("driven", "loose"):
        below = pin.SE3(np.eye(3), np.array([0, 0, -0.3]))
        joint = model.addJoint(model.njoints - 1, pin.JointModelRY(), below, name)
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    robot = Robot("chain", model, Transmission(("driven",), [10.0], [1e-5]))
    with pytest.raises(DesignError, match="loose"):
        rivals("viscous_friction@driven", robot=robot)


def test_what_a_diagnosis_does_not_read_speaks_for_no_cause() -> None:
    """Torques above its band, and rows about a reversal, are worth nothing."""
    time = np.arange(1001)[:, None] / 100.0

    def told(frequency: float, band: float) -> float:
        omega, moves = 2.0 * np.pi * frequency, np.array([0.0, 2.0])  # at all, the same speeds
        wave, speed = np.sin(omega * time) * moves, np.cos(omega * time) * moves
        motion = Motion(LEG.pose() + wave / omega, speed, -omega * wave, time[:, 0])
        return replace(FRICTION, band=band).predictions(motion).signal(0)

    whole = told(1.0, np.inf)
    assert told(8.0, np.inf) == pytest.approx(whole, rel=0.05)
    assert told(8.0, 5.0) < 0.01 * whole
    assert 0.7 * whole < told(1.0, 5.0) < whole
    assert told(8.0, 40.0) > 0.7 * whole


@pytest.mark.parametrize("duration", [2.0, 4.0, 10.0])
def test_random_motions_hold_a_period_as_far_as_two_hertz_allow(duration: float) -> None:
    for path in random_paths(rivals("rotor_inertia@knee"), LIMITS, duration, 0, 6):
        assert path.frequency >= min(1.0 / duration, 0.4)
        assert path.frequency * path.sine.shape[1] <= 2.0 + 1e-9


def test_a_slide_and_seven_axes_are_planned_with_motors_that_can_hold_them_still() -> None:
    """Each of these once hung, crashed or said nothing."""
    robot = load_robot("tiago").lossless()
    still = Motion(MotionLimits.of(robot).center[None], *np.zeros((2, 1, robot.model.nv)))
    held = np.abs(rotor_torque(robot, still, link_torque(robot, still))[0][0])

    def planned(share: float) -> tuple[Rivals, MotionLimits]:
        limits = np.maximum(held / share, 1.5)
        strong = robot.with_transmission(robot.transmission.replace(torque_limit=limits))
        causes = ("payload_mass@arm_7_link", "viscous_friction@torso_lift_joint")
        return rivals(*causes, robot=strong), MotionLimits.of(strong)

    found = design_experiment(*planned(0.5), 2.0, rounds=2)
    assert found.used <= 0.81
    assert found.worst > 0.0
    message = r"holding still takes 13\d % of the torque limit of 'torso_lift_joint'"
    with pytest.raises(DesignError, match=message):
        next(random_paths(*planned(1.3), 2.0, 0, 1))
    with pytest.raises(DesignError, match=message):
        design_experiment(*planned(1.3), 2.0, rounds=2)


def test_a_short_motion_keeps_its_limits_at_the_rate_of_the_log() -> None:
    """Half a second has 26 rows of the search, between which its peaks lie."""
    chosen = rivals("payload_mass@shin", "rotor_inertia@knee")
    limits = MotionLimits.of(LEG, span=1.0, speed=6.0, acceleration=100.0)
    assert design_experiment(chosen, limits, 0.5, rounds=3, aim=deciding).used <= 0.8


TIMES = [({"duration": d}, f"must be > 0 and finite, got {d:g}") for d in (np.nan, np.inf, -1.0)]
FEW = [({"rate": r}, f"needs 10 rows per second or more; the rate is {r:g}") for r in (np.nan, 1.0)]
MANY = [({"rate": np.inf}, "rate of an experiment must be > 0 and finite, got inf")]


@pytest.mark.parametrize(("settings", "message"), [*TIMES, *FEW, *MANY])
def test_a_time_or_rate_that_is_none_is_named(settings: dict[str, float], message: str) -> None:
    given = {"duration": 2.0, "rate": 100.0, **settings}
    with pytest.raises(DesignError, match=message):
        design_experiment(FRICTION, LIMITS, rounds=1, **given)  # type: ignore[arg-type]
