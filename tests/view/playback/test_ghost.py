"""The ghost lies on a right model's measurement and leaves a wrong one's in its direction."""

import numpy as np
import pytest

import wbc
from tests.control.scenes import place_of
from tests.moved import exact_log, moved
from wbc.effects import CoulombFriction, ViscousFriction
from wbc.identification.answer.shown import series_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Motion, Robot
from wbc.view import model_ghost
from wbc.view.report import residual_plots

ROBOT = wbc.load_robot("planar_leg_fixed").lossless()


def swing(robot: Robot, noise: float = 0.0, seed: int = 0) -> Log:
    """Eight seconds of the fixed leg, exact motion and the torques `robot` needs, with noise."""
    waves = [[(0.5, rate, 0.0)] for rate in (2.1, 3.3)]
    return moved(robot, np.arange(0.0, 8.0, 2e-3), waves, noise=(0.0, 0.0, noise), seed=seed)


def test_a_right_model_lies_on_the_measurement() -> None:
    log = swing(ROBOT)
    ghost = model_ghost(ROBOT, log, np.full(2, 0.01))
    measured = np.stack(
        [np.interp(ghost.time, log.time, log.column(f"{j}.position")) for j in ROBOT.joints]
    )
    inner = (ghost.time > 0.5) & (ghost.time < 7.5)
    np.testing.assert_allclose(ghost.position[inner], measured.T[inner], atol=2e-3)


def test_a_model_without_friction_runs_ahead() -> None:
    log = swing(ROBOT.with_effect(ViscousFriction("knee", 0.4)))
    ghost = model_ghost(ROBOT, log, np.full(2, 0.01))
    position, speed = (
        np.interp(ghost.time, log.time, log.column(f"knee.{q}")) for q in ("position", "velocity")
    )
    inner = (ghost.time > 1.0) & (ghost.time < 7.0)
    lead = (ghost.position[:, 1] - position)[inner]  # of the knee
    # The spring answers a slow push with the push itself, later: correlate over its delay.
    shifts = range(0, 200, 5)
    best = max(np.corrcoef(np.roll(lead, -s)[:-200], speed[inner][:-200])[0, 1] for s in shifts)
    assert best > 0.95
    assert np.abs(lead).max() > 0.01
    # Its residual is the friction torque it lacks, in floors of 0.01 N m.
    at = np.interp(ghost.residual_time, log.time, log.column("knee.velocity"))
    # (Rows near a reversal of any joint weigh less, hence the median.)
    fast = np.abs(at) > 0.5
    ratio = ghost.residual["knee"][fast] / at[fast]
    assert np.median(ratio) == pytest.approx(40.0, rel=0.01)
    assert np.all(ratio > 0.0)


def test_a_free_base_is_held_by_its_foot(leg: Robot, squat: Log) -> None:
    stance = squat.between(0.3, 2.0)
    names = ("base_x", "base_z", "base_pitch", "hip", "knee")
    q, v = (stance.stack(quantity, names) for quantity in ("position", "velocity"))
    motion = Motion(q, v, np.gradient(v, stance.time, axis=0), time=stance.time)
    force = np.stack([stance.column(f"foot.force.{x}") for x in "xyz"], axis=1)
    lossless = leg.lossless()
    log = exact_log(lossless.with_effect(CoulombFriction("knee", 3.0)), motion, {"foot": force})
    ghost = model_ghost(lossless, log)
    feet = [place_of(leg, row, "foot") for row in ghost.position[20:-20]]
    measured = np.stack([np.interp(ghost.time, log.time, q[:, i]) for i in (3, 4)], axis=1)
    shift = np.linalg.norm((ghost.position[:, 3:] - measured)[20:-20], axis=1).max()
    assert shift > 0.01
    # First order: a shift of e leaves the foot off by about e^2 times a link.
    assert np.abs(np.array(feet) - feet[0]).max() < max(1e-3, 0.8 * shift**2)


def test_residuals_before_and_after_and_their_plots() -> None:
    truth = ROBOT.with_effect(CoulombFriction("hip", 0.7))
    problem = EstimationProblem.from_logs(ROBOT, [swing(truth, 2e-3, seed) for seed in (0, 1)])
    given, fitted = (series_of(one, problem.records) for one in (ROBOT, truth))
    plots = residual_plots(problem, given, fitted)
    assert [panel["output"] for panel in plots["panels"]] == ["hip", "knee"]
    hip = plots["panels"][0]
    speed, *_ = hip["over"]
    assert (speed["name"], speed["unit"]) == ("speed", "rad/s")
    fast = np.abs(speed["x"]) > 0.5
    np.testing.assert_allclose(np.abs(hip["before"])[fast], 0.7, atol=0.05)
    assert np.abs(hip["after"])[fast].max() < 0.1
