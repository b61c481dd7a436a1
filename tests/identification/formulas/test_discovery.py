"""Formulas hidden in a closed-form leg are found; what has none is declined or labelled.

Motions are sums of sines, so that positions, speeds and accelerations are exact; the torque is what
Lagrange's equations ask for, with no code of the library, plus what the added torque takes.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from tests.conftest import Told
from tests.outside import outside, recorded
from tests.recover.plant import JOINTS, RATIO, REFLECTED, Flaws, Lane
from wbc import load_robot
from wbc.effects import CoulombFriction, PayloadMass, TorqueOffset, ViscousFriction
from wbc.errors import LogError
from wbc.identification import compare, diagnose
from wbc.identification.formulas import discover
from wbc.measurement import Log, load_logs, save_log


class Moving(NamedTuple):
    """One run: (N, 2) arrays of hip and knee, and the torque that the links ask of them."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    load: np.ndarray


Torque = Callable[[Moving], tuple[np.ndarray | float, np.ndarray | float]]


def logs(
    torque: Torque, seeds: tuple[int, ...] = (1, 2), size: float = 1.0, noise: float = 1.0
) -> list[Log]:
    """Return one log per seed of a leg on whose hip and knee `torque` acts."""
    return [_log(torque, seed, size, noise) for seed in seeds]


def _log(torque: Torque, seed: int, size: float, noise: float) -> Log:
    random, time = np.random.default_rng(seed), np.arange(0.0, 6.0, 0.004)
    frequency = 2.0 * np.pi * random.uniform(0.1, 1.5, (2, 5, 1))
    height = size * 0.35 * random.uniform(0.5, 1.0, (2, 5, 1)) / (0.4 + frequency / (2.0 * np.pi))
    angle = frequency * time + random.uniform(0.0, 2.0 * np.pi, (2, 5, 1))
    q = (height * np.sin(angle)).sum(axis=1).T + np.array([0.3, -0.4])
    v = (height * frequency * np.cos(angle)).sum(axis=1).T
    a = -(height * frequency**2 * np.sin(angle)).sum(axis=1).T
    mass, bias = Flaws([Lane()]).links(q, v)
    load = np.einsum("nij,nj->ni", mass, a) + bias
    added = torque(Moving(time, q, v, load))
    extra = np.stack([np.broadcast_to(t, time.shape) for t in added], axis=1)
    rotor, columns = (load + REFLECTED * a - extra) / RATIO, {}
    drawn = noise * np.random.default_rng(500 + seed).standard_normal((2, 3, time.size))
    for k, joint in enumerate(JOINTS):
        columns[f"{joint}.position"] = q[:, k] + 2e-5 * drawn[k, 0]
        columns[f"{joint}.velocity"] = v[:, k] + 3e-3 * drawn[k, 1]
        columns[f"{joint}.rotor_torque"] = rotor[:, k] + 2e-3 * drawn[k, 2]
    return Log(time, columns)


LEG = load_robot("planar_leg_fixed").lossless()

HIDDEN: dict[str, tuple[Torque, dict[str, dict[str, float]]]] = {
    "friction that differs by direction, and drag of the product of speeds": (
        lambda r: (np.where(r.v[:, 0] > 0.0, -0.6, 0.2), 0.2 * r.v[:, 0] * r.v[:, 1]),
        {"hip": {"1": -0.2, "sign(v_hip)": -0.4}, "knee": {"v_knee * v_hip": 0.2}},
    ),
    "friction that changes with position": (
        lambda r: (0.0, -(0.5 + 0.3 * np.cos(2.0 * r.q[:, 1])) * np.sign(r.v[:, 1])),
        {"knee": {"sign(v_knee)": -0.5, "cos(2 q_knee) * sign(v_knee)": -0.3}},
    ),
    "a cable from the hip that pulls at the knee": (
        lambda r: (0.0, -0.9 * np.sin(2.0 * r.q[:, 0])),
        {"knee": {"sin(2 q_hip)": -0.9}},
    ),
    "cubic drag, and a bearing that the other joint's load presses": (
        lambda r: (-0.05 * r.v[:, 0] ** 3, -0.08 * np.abs(r.load[:, 0]) * np.sign(r.v[:, 1])),
        {"hip": {"v_hip^3": -0.05}, "knee": {"|load_hip| * sign(v_knee)": -0.08}},
    ),
    "friction that grows with position, and drag of the other joint": (
        lambda r: (-0.3 * np.abs(r.q[:, 0]) * np.sign(r.v[:, 0]), 0.25 * r.v[:, 0]),
        {"hip": {"|q_hip| * sign(v_hip)": -0.3}, "knee": {"v_hip": 0.25}},
    ),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_a_formula_of_the_library_is_found_with_its_numbers(name: str) -> None:
    torque, truth = HIDDEN[name]
    found = discover(LEG, logs(torque))
    assert found.outcome == "formula"
    assert {p.effect.where: set(p.effect.values) for p in found.proposals} == {
        joint: set(terms) for joint, terms in truth.items()
    }
    for proposal in found.proposals:
        assert proposal.share > 0.98
        for term, value in truth[proposal.effect.where].items():
            estimate = proposal.coefficients[term]
            assert estimate.value == pytest.approx(value, rel=0.03)
            assert estimate.low < estimate.value < estimate.high
            assert abs(estimate.value - value) < 3.0 * (estimate.high - estimate.low)
            assert proposal.stability[term] >= 0.8
    unseen = logs(torque, seeds=(9,))
    assert compare(found.robot, unseen).error < 1.5 < compare(LEG, unseen).error


def test_the_period_of_a_wave_is_read_off_the_data() -> None:
    (proposal,) = discover(LEG, logs(lambda r: (0.0, 0.5 * np.sin(17.3 * r.q[:, 1])))).proposals
    (term,) = proposal.effect.terms
    assert term.factors[0].shape == "sin"
    assert term.factors[0].number == pytest.approx(17.3, abs=0.05)
    assert term.coefficient == pytest.approx(0.5, rel=0.03)


@pytest.mark.parametrize(
    ("seeds", "size", "noise"),
    [((3,), 1.0, 1.0), ((4, 5), 0.4, 3.0), ((6, 7, 8), 0.7, 1.0), ((9, 10), 1.2, 0.3)],
)
def test_nothing_is_proposed_where_nothing_is_missing(
    seeds: tuple[int, ...], size: float, noise: float
) -> None:
    found = discover(LEG, logs(lambda r: (0.0, 0.0), seeds, size=size, noise=noise))
    assert (found.outcome, found.proposals, found.remainder) == ("none", (), "")
    assert found.robot.effects == ()
    assert "No formula found" in found.summary


def test_a_law_outside_the_library_is_approximated_and_holds_on_other_logs() -> None:
    """Friction that rises like an arctangent: no product of the library, but near some."""

    def saturating(run: Moving) -> tuple[float, np.ndarray]:
        return 0.0, -0.6 * np.arctan(run.v[:, 1] / 0.6)

    found = discover(LEG, logs(saturating))
    assert found.proposals
    assert {p.effect.where for p in found.proposals} == {"knee"}
    unseen = logs(saturating, seeds=(9,))
    assert compare(found.robot, unseen).error < 0.3 * compare(LEG, unseen).error
    assert found.error.after < 0.3 * found.error.before


def test_a_joint_that_stands_still_shows_no_law() -> None:
    given = []
    for log in logs(lambda r: (-0.4 * np.sign(r.v[:, 0]), 0.0)):
        still = {name: np.zeros_like(c) for name, c in log.columns.items() if "knee" in name}
        given.append(Log(log.time, log.columns | still))
    assert {p.effect.where for p in discover(LEG, given).proposals} <= {"hip"}
    nowhere = [Log(g.time, {n: np.zeros_like(c) for n, c in g.columns.items()}) for g in given]
    with pytest.raises(LogError, match="no joint moves"):
        discover(LEG, nowhere)


@pytest.mark.parametrize(
    "torque",
    [
        lambda run: (0.0, 0.4 * np.sin(2.0 * np.pi * 0.7 * run.time)),
        lambda run: (0.0, 0.5 * np.sin(1e3 * run.q[0, 0])),
    ],
    ids=["a function of time", "an offset of each run"],
)
def test_what_is_no_function_of_the_motion_is_declined(torque: Torque) -> None:
    found = discover(LEG, logs(torque, seeds=(1, 2, 3)))
    assert found.outcome == "none"
    assert "knee" in found.remainder


def bouc_wen(run: Moving, joint: int, level: float, rate: float) -> np.ndarray:
    """Return the torque of rate-independent hysteresis that saturates at `level` [N m]."""
    state, step, torque = 0.0, run.time[1] - run.time[0], np.empty(len(run.time))
    for k, speed in enumerate(run.v[:, joint]):
        torque[k] = -level * state
        state += step * rate * (speed - abs(speed) * state)
    return torque


def test_hysteresis_is_declined_or_called_a_part() -> None:
    given = logs(lambda run: (0.0, bouc_wen(run, 1, 0.6, 6.0)))
    diagnosis = diagnose(LEG, given, [ViscousFriction, CoulombFriction])
    assert diagnosis.verdict == "unknown"
    for found in (discover(LEG, given), discover(LEG, given, known=diagnosis.effects)):
        assert found.outcome in ("none", "partial")
        assert "memory" in found.remainder
        assert all(p.share < 0.97 for p in found.proposals)
        assert ("memory" in found.summary) == bool(found.proposals)


def test_named_effects_stay_beside_formulas_and_idle_ones_go() -> None:
    torque = HIDDEN["friction that changes with position"][0]
    heavy = LEG.with_effect(PayloadMass("foot", 0.3))
    believed = [PayloadMass("foot", -0.2), CoulombFriction("hip", 0.1)]
    found = discover(heavy, logs(torque), known=believed)
    assert found.outcome == "formula"
    assert found.dropped == (("coulomb_friction", "hip"),)
    (payload,) = found.known
    assert payload.values["mass"] == pytest.approx(-0.3, abs=0.003)
    low, high = found.intervals["payload_mass", "foot", "mass"]
    assert low < payload.values["mass"] < high
    (proposal,) = found.proposals
    assert set(proposal.effect.values) == {"sign(v_knee)", "cos(2 q_knee) * sign(v_knee)"}
    assert found.robot.effects == (heavy.effects[0], payload, proposal.effect)


def test_products_that_do_as_well_are_listed() -> None:
    # The knee stays on one side of zero: the sizes and the values of its angle are the same.
    given = logs(lambda r: (-0.8 * np.abs(r.q[:, 1]) * np.sign(r.v[:, 0]), 0.0), size=0.25)
    assert max(log.columns["knee.position"].max() for log in given) < 0.0
    (proposal,) = discover(LEG, given).proposals
    (term,) = proposal.effect.values
    assert term == "|q_knee| * sign(v_hip)"
    assert "q_knee * sign(v_hip)" in proposal.rivals[term]


def test_the_command_line_prints_writes_and_saves(tmp_path: Path, told: Told) -> None:
    torque = HIDDEN["a cable from the hip that pulls at the knee"][0]
    paths = [save_log(log, tmp_path / f"{k}.csv") for k, log in enumerate(logs(torque))]
    fitted, content = tmp_path / "fitted.toml", tmp_path / "out.json"
    command = "diagnose --robot planar_leg_fixed --lossless --add viscous_friction,torque_offset"
    files = [*paths, "--save", fitted, "--json", content]
    printed = told(*command.split(), "--discover", *files, code=1)
    assert "formulas proposed by regression, not causes" in printed
    assert re.search(r"tau_knee = -0\.9\d* N m \* sin\(2 q_hip\)", printed)
    found = json.loads(content.read_text())["discovery"]
    assert found["proposals"][0]["terms"]["sin(2 q_hip)"]["value"] == pytest.approx(-0.9, rel=0.01)
    assert compare(load_robot(fitted), logs(torque, seeds=(9,))).error < 1.5
    assert "low = " in fitted.read_text()


def test_a_practice_log_of_a_standing_leg_that_lacks_nothing() -> None:
    leg = load_robot("planar_leg").lossless()
    assert discover(leg, load_logs([outside("practice_leg/float00a.csv")])).outcome == "none"


def test_a_ball_screw_rubs_less_in_one_direction() -> None:
    """The published identification has viscous, Coulomb friction and offset; more is there."""
    slide, (log,) = recorded("emps")
    rubs = ViscousFriction("slide", 203.5034), CoulombFriction("slide", 20.3935)
    published = slide.with_effects(*rubs, TorqueOffset("slide", 3.1648))
    end = int(0.6 * len(log))
    found = discover(slide, [log[:end]])
    (proposal,) = found.proposals
    values = proposal.effect.values
    assert values["v_slide"] == pytest.approx(-203.5, rel=0.05)
    assert values["sign(v_slide)"] == pytest.approx(-20.4, rel=0.05)
    assert 20.0 < values["|v_slide|"] < 60.0
    assert proposal.coefficients["|v_slide|"].unit == "N s/m"
    unseen = [log[end:]]
    assert compare(found.robot, unseen).error < 0.75 * compare(published, unseen).error


def test_a_double_pendulum_on_trajectories_that_nobody_fitted() -> None:
    arm, given = recorded("double_pendulum")
    found = discover(arm, given[::4])
    assert found.outcome == "partial"
    for proposal in found.proposals:
        dry = proposal.effect.values[f"sign(v_{proposal.effect.where})"]
        # Published, from other logs: 1.57 * 0.093 and 1.57 * 0.078 N m.
        assert dry == pytest.approx(-0.14, rel=0.25)
    assert compare(found.robot, given[1::4]).error < 0.6 * compare(arm, given[1::4]).error


def test_an_arm_with_a_coupled_wrist() -> None:
    arm, (log,) = recorded("staubli_tx40")
    found = discover(arm, [log[: 2 * len(log) // 3]])
    terms = {proposal.effect.where: proposal.effect.values for proposal in found.proposals}
    assert terms["joint_4"]["sign(v_joint_4)"] == pytest.approx(-2.2, rel=0.2)
    assert found.error.after < 0.5 * found.error.before
