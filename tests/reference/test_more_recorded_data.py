"""Recorded pendulums and an arm: from a stranger's files to an answer, and what is known of them.

The logs live outside the repository, in `../shared/data`; without them these tests are skipped.
"""

import tomllib
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Told
from tests.outside import ROOT, outside
from wbc.effects import EFFECTS, CoulombFriction, TorqueConstant, ViscousFriction, load_robot
from wbc.identification import diagnose, open_loop
from wbc.identification.choice.evidence import weigh
from wbc.identification.choice.trials import Trials
from wbc.identification.classic import classic_fit, held_out_residual
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import load_logs
from wbc.robot import Effect, Robot

RICMONK = ROOT / "robots" / "ricmonk"


def test_friction_of_a_continuous_pendulum_shows() -> None:
    logs = [outside(f"simple_pendulum/{name}.parquet") for name in ("direct_collocation", "ddp")]
    robot, read = load_robot("simple_pendulum"), load_logs(logs)
    problem = EstimationProblem.from_logs(robot, read)
    fit = problem.fit([CoulombFriction("pendulum", level=0.05)])
    # Least squares on each log alone gives 0.16 and 0.21 N m beside a heavier load.
    assert 0.1 < fit.effects[0].values["level"] < 0.35
    before, after = open_loop(robot, read), open_loop(fit.robot, read)
    assert after.error[0, 1] < 0.8 * before.error[0, 1]


def test_no_soft_gear_is_named_from_a_report_that_does_not_follow_the_motion() -> None:
    robot = load_robot("simple_pendulum")
    read = load_logs([str(outside("simple_pendulum/pd_identification.parquet"))])
    # The chattering torque was explained by a spring of 81 N m/rad, at 0.999. With it, what the
    # swing-up leaves is twice as much as without.
    found = diagnose(robot, read)
    assert found.silent == ("pendulum",)
    assert found.verdict == "unknown"
    assert not found.findings


def test_the_arm_without_a_drive_gets_no_gear(tmp_path: Path, told: Told) -> None:
    log = outside("ricmonk/TVLQR_3xForward.parquet")
    said = told("init", RICMONK / "ricmonk.urdf", log, "--out", tmp_path)
    assert "taken for a joint without a drive" in said
    robot, columns = tmp_path / "robot.toml", tmp_path / "columns.toml"
    assert list(tomllib.loads(robot.read_text())["gears"]) == ["Joint1", "Joint3"]
    checked = told("check", log, "--robot", robot, "--columns", columns, "--verbose")
    # Six columns lack the same rows: one remark, not six.
    assert checked.count("Repair the file") == 1


def test_the_outer_arm_of_ricmonk_has_the_friction_and_load_that_least_squares_shows() -> None:
    path = str(outside("ricmonk/TVLQR_6xForward.parquet"))
    robot = load_robot("ricmonk")
    ratios = dict.fromkeys(robot.transmission.joints, 6.0)
    logs = load_logs([path], RICMONK / "columns.toml", gear_ratios=ratios)
    assert len(logs) == 3
    problem = EstimationProblem.from_logs(robot, logs)
    fit = problem.fit([CoulombFriction(j, level=0.05) for j in robot.transmission.joints])
    outer = fit.effects[1].values["level"]
    assert 0.06 < outer < 0.16
    row = robot.transmission.joints.index("Joint3")
    left = np.sqrt(np.mean(problem.residual[:, row] ** 2))
    assert 0.05 < left < 0.2


def test_a_payload_shows_beside_a_robot_that_was_fitted_without_it() -> None:
    robot = load_robot("ricmonk")

    def effect(name: str, where: str, given: Robot) -> Effect:
        return EFFECTS[name].at(where, EFFECTS[name].null_values(given, where))

    def problem_of(given: Robot, *names: str) -> EstimationProblem:
        files = [str(outside(f"ricmonk/TVLQR_{name}.parquet")) for name in names]
        return EstimationProblem.from_logs(given, load_logs(files, RICMONK / "columns.toml"))

    kinds = product(("coulomb_friction", "rotor_inertia"), robot.transmission.joints)
    usual = [effect(*kind, robot) for kind in kinds]
    bare = problem_of(robot, "3xForward", "6xForward")
    fitted = bare.fit([*usual, effect("link_inertia", "link2", robot)]).robot
    loaded = Trials(problem_of(fitted, "3xForward_170gm_asymmetricLoad"))
    causes = ("payload_mass", "link2"), ("link_inertia", "link2"), ("torque_constant", "Joint3")
    found = [loaded.of((effect(name, where, fitted),)) for name, where in causes]
    hypotheses = [loaded.nothing, *(h for h in found if h is not None)]
    assert len(hypotheses) == 4
    nothing, payload, link, drive = weigh(loaded.problem, hypotheses)
    assert payload > max(nothing, link, drive)
    # Least squares of the outer arm alone: 0.053 kg m without and 0.072 with the payload.
    bodies = fitted, loaded.fit(hypotheses[2]).robot
    inertias = [body.model.inertias[body.body_joint("link2")] for body in bodies]
    moments = [np.linalg.norm(inertia.mass * inertia.lever) for inertia in inertias]
    np.testing.assert_allclose(moments, [0.053, 0.072], rtol=0.05)


def test_tiagos_arm_is_explained_as_well_as_by_least_squares_without_its_silent_drives() -> None:
    robot = load_robot("tiago").lossless()
    path = str(outside("tiago/tiago.parquet"))
    logs = load_logs([path], ROOT / "robots" / "tiago" / "columns.toml")
    problem = EstimationProblem.from_logs(robot, logs)
    arm = tuple(f"arm_{k}_joint" for k in (1, 2, 3, 4))
    assert problem.judged_joints == (*arm, "arm_7_joint")
    # Friction and, at arm_2, a torque constant: what its drive reports is 0.8 of what it carries.
    effects = [ViscousFriction(joint, coefficient=1.0) for joint in arm]
    effects += [CoulombFriction(joint, level=1.0) for joint in arm]
    fit = problem.fit([*effects, TorqueConstant(arm[1], factor=1.1)])
    assert fit.effects[-1].values["factor"] == pytest.approx(1.20, abs=0.03)
    left = held_out_residual(
        problem, lambda used: fit.residual[~used] + fit.jacobian[~used] @ fit.step(used)
    )
    ratio = np.sqrt(np.mean(left**2, axis=0)) / classic_fit(problem).left
    assert ratio[1] < 1.02
