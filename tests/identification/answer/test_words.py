"""What an answer says: arguments that it refuses, units, what to do now and what to record next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.moved import swing
from tests.outside import ROOT
from wbc import load_robot
from wbc.effects import EFFECTS, CoulombFriction, LoadFriction, PositionOffset, ViscousFriction
from wbc.errors import IdentificationError, LogError
from wbc.identification import Diagnosis, compare, diagnose
from wbc.identification.answer.diagnose import next_experiment
from wbc.identification.answer.diagnosis import Alternative, Finding, Verdict
from wbc.identification.answer.remainder import Remainder
from wbc.identification.answer.words import COMMAND, Commands, what_to_do
from wbc.identification.choice.certainty import Support
from wbc.identification.records.noise import NoiseFloor
from wbc.measurement import Log
from wbc.robot import Effect

TIME = np.arange(1000) * 0.005
LOG = Log(TIME, {"hip.position": np.sin(TIME), "knee.position": np.cos(TIME)})


@pytest.mark.parametrize("what", [compare, diagnose])
def test_names_single_logs_and_paths_are_told_in_words(what: Callable[..., object]) -> None:
    robot = load_robot("planar_leg_fixed")
    for arguments, says in (
        (("planar_leg_fixed", [LOG]), r"not 'planar_leg_fixed'; load it with load_robot"),
        ((robot, LOG), r"give one log as \[log\]"),
        ((robot, "run.csv"), r"not 'run.csv'; read files with load_logs"),
        ((robot, Path("run.csv")), r"not 'run.csv'; read files with load_logs"),
        ((robot, 3), r"logs are expected, not '3'"),
        ((robot, ["run.csv"]), r"not 'run.csv'; read files with load_logs"),
    ):
        with pytest.raises(IdentificationError, match=says):
            what(*arguments)


@pytest.mark.parametrize("what", [compare, diagnose])
def test_a_description_without_gears_is_told_in_words(
    what: Callable[..., object], tmp_path: Path
) -> None:
    model = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
    (tmp_path / "robot.toml").write_text(f'name = "bare"\nmodel = "{model}"\n')
    with pytest.raises(IdentificationError, match=r"'bare' has no gears(?s:.*)\[gears.JOINT\]"):
        what(load_robot(tmp_path / "robot.toml"), [LOG])


LEG = load_robot("planar_leg_fixed").lossless()


def commands_in(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.startswith(COMMAND)]


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    truth = LEG.with_effect(CoulombFriction("knee", 0.4))
    return [swing(truth, 1, 0.0), swing(truth, 2, 0.0)]


@pytest.fixture(scope="module")
def found(logs: list[Log]) -> Diagnosis:
    return diagnose(LEG, logs, [CoulombFriction])


def test_what_is_saved_already_is_not_saved_again(found: Diagnosis) -> None:
    told = what_to_do(found, Commands(["a run.csv"], "leg.toml", saved="new.toml", lossless=True))
    assert commands_in(told) == ["wbc compare 'a run.csv' --robot new.toml"]
    # --lossless would take the losses that were found out of the corrected model again.
    assert "--lossless" not in told
    assert told.endswith("Then use new.toml in place of leg.toml.")


def test_logs_of_other_machines_keep_their_losses(found: Diagnosis) -> None:
    """With --lossless, LOG@ROBOT is read without losses; beside the corrected robot it is not."""
    told = what_to_do(found, Commands(["a.csv", "b.csv@other.toml"], "leg.toml", lossless=True))
    (save,) = commands_in(told)
    assert (
        save == "wbc diagnose a.csv b.csv@other.toml --robot leg.toml --lossless --save fitted.toml"
    )


@pytest.mark.parametrize(
    ("verdict", "begins", "last"),
    [
        ("named", "Use the corrected model. Save it", "compare a.csv --robot fitted.toml"),
        ("partial", "Use the corrected model. Save it", "diagnose a.csv new.csv --robot leg"),
        ("ambiguous", "Use the corrected model: it predicts best", "a.csv new.csv --robot leg"),
        ("unknown", "Use the corrected model: it predicts best", "a.csv new.csv --robot leg"),
        ("not_repeatable", "Look at the robot first", "diagnose new1.csv new2.csv --robot leg"),
        ("none", "Neither the robot nor its model needs a change", ""),
    ],
)
def test_every_answer_says_whether_the_robot_is_to_be_touched(
    found: Diagnosis, verdict: str, begins: str, last: str
) -> None:
    one = replace(found, verdict=verdict, next_experiment="Turn the knee slowly.")  # type: ignore
    told = what_to_do(one, Commands(["a.csv"], "leg"))
    assert told.startswith(begins)
    assert not last or commands_in(told)[-1].endswith(last)


def test_in_python_the_way_out_is_a_line_of_python(
    found: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (line,) = commands_in(what_to_do(found))
    exec(line, {"found": found})
    assert str(load_robot("fitted.toml").effects) == str(found.robot.effects)


def test_one_word_and_one_number_for_the_noise(found: Diagnosis, logs: list[Log]) -> None:
    """ "Noise floor" and "noise of the sensors" stood for two numbers that differed by a third."""
    floor = {o.output: o.floor for o in compare(LEG, logs).outputs}
    assert {o.output: o.floor for o in found.outputs} == pytest.approx(floor)
    assert "noise floor" in str(found)
    assert "sensors" not in str(found)


def test_an_answer_says_which_gears_are_still_guessed(logs: list[Log], tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(
        'robot = "planar_leg_fixed"\n[gears.knee]\nrotor_inertia = { value = 6.7e-5, '
        'unit = "kg m^2", source = "guess: not in the model file; look it up" }\n'
    )
    found = diagnose(load_robot(str(path)).lossless(), logs, [CoulombFriction])
    assert found.verdict == "named"
    assert found.warnings[0].startswith("Look up gears.knee.rotor_inertia in robot.toml")


FLOOR = NoiseFloor(np.eye(2), np.eye(2), ())
REPEATED = NoiseFloor(np.eye(2), np.eye(2), ((0, 1),))


def _finding(effect: Effect, *alternatives: str) -> Finding:
    rivals = tuple(Alternative(*name.split(" at ")) for name in alternatives)
    return Finding(effect, {}, Support(0.5, 1.0, 0.0, 0.0, explained=True), rivals)


def _said(effect: Effect, *alternatives: str) -> str:
    return next_experiment("ambiguous", [_finding(effect, *alternatives)], (), FLOOR, EFFECTS)


@pytest.mark.parametrize(
    ("effect", "rival", "words"),
    [
        (PositionOffset("knee", 0.1), "center_of_mass", "spirit level"),
        (PositionOffset("hip", 0.1), "gravity_direction", "tilted"),
        (LoadFriction("knee", 0.1), "transmission_efficiency", "no run tells them apart"),
    ],
)
def test_exact_equals_are_called_so_in_either_order(effect: Effect, rival: str, words: str) -> None:
    assert words in _said(effect, f"{rival} at {effect.where}")
    other = EFFECTS[rival].at("x")
    assert words in _said(other, f"{effect.name} at x")
    motion = EFFECTS[rival].experiment.partition(":")[0][1:]
    assert motion in _said(effect, f"{rival} at {effect.where}")


def test_many_rivals_ask_for_few_motions() -> None:
    said = _said(CoulombFriction("hip", 0.3), *(f"{name} at hip" for name in sorted(EFFECTS)))
    motions = said.partition("At hip: ")[2].partition(". ")[0]
    assert motions.startswith("move the joint slowly back and forth through the same positions;")
    assert motions.count("; ") == 2


def test_every_inseparable_effect_exists() -> None:
    for kind in EFFECTS.values():
        assert set(kind.search.inseparable) <= set(EFFECTS) - {kind.name}


def left(clue: str, elsewhere: str = "", memory: bool = False) -> Remainder:
    return Remainder("knee", 1.0, "N m", 20.0, ((clue, 0.5),), elsewhere, 1.0, memory)


@pytest.mark.parametrize(
    ("remainder", "words"),
    [
        (left("acceleration"), "inertia of a link or rotor"),
        (left("load"), "centre of mass"),
        (left("speed", memory=True), "strokes of several sizes"),
        (left("time"), "for several minutes"),
        (left("speed of hip", elsewhere="hip"), "Move hip alone while knee holds still"),
    ],
    ids=["inertia", "mass", "memory", "time", "elsewhere"],
)
def test_what_is_left_says_what_to_record(remainder: Remainder, words: str) -> None:
    for verdict in ("unknown", "partial"):
        assert words in next_experiment(verdict, [], [remainder], REPEATED, EFFECTS)


def test_a_floor_that_is_only_a_bound_asks_for_a_repeat() -> None:
    one = left("speed")
    assert "Repeat one run exactly" in next_experiment("unknown", [], [one], FLOOR, EFFECTS)
    assert "Repeat" not in next_experiment("unknown", [], [one], REPEATED, EFFECTS)


@pytest.mark.parametrize("verdict", ["unknown", "partial"])
def test_drives_that_report_only_noise_come_first(verdict: Verdict) -> None:
    said = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip", "knee"))
    assert said.startswith("The drives of hip and knee report only noise")
    assert "constant speeds" not in said  # nothing is known of the knee
    both = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip",))
    assert both.startswith("The drive of hip reports only noise, so these logs say nothing about ")
    assert "Turn knee at several constant speeds" in both


def test_nobody_is_asked_to_hold_a_joint_still_that_no_motor_moves() -> None:
    left = Remainder("shoulder", 1.0, "N m", 20.0, (("load", 0.5),), "elbow", 1.0, True, False)
    assert left.experiment.startswith("move elbow alone: what is left at shoulder")
    assert not replace(left, elsewhere="").experiment


def test_a_floor_that_cannot_be_is_not_counted_in() -> None:
    left = Remainder("knee", 1.0, "N m", 58383.0, (), "", 1.0, False)
    assert "more than 100 times the noise floor" in left.text
    assert "58383" not in left.text


@pytest.fixture(scope="module")
def sliding() -> Diagnosis:
    robot = load_robot("emps")
    bare = robot.without_effects()
    ratio = float(robot.transmission.gear_ratio[0])
    mass = (
        float(bare.model.inertias[1].mass) + float(robot.transmission.rotor_inertia[0]) * ratio**2
    )
    logs = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 6.0, 1e-3)
        waves = [(0.05 / w, w, rng.uniform(0.0, 6.0)) for w in (2.0, 5.0, 9.0)]
        place = sum(a * np.sin(w * t + p) for a, w, p in waves)
        speed = sum(a * w * np.cos(w * t + p) for a, w, p in waves)
        push = mass * sum(-a * w * w * np.sin(w * t + p) for a, w, p in waves)
        push += 20.0 * np.sign(speed) + 0.05 * rng.standard_normal(len(t))
        columns = {"slide.position": place, "slide.velocity": speed, "slide.motor_torque": push}
        logs.append(Log(t, columns))
    return diagnose(bare, logs, [CoulombFriction, ViscousFriction])


def test_a_sliding_joint_is_answered_in_newtons_and_metres(sliding: Diagnosis) -> None:
    (friction,) = [f for f in sliding.findings if f.effect.name == "coulomb_friction"]
    assert friction.parameters["level"].value == pytest.approx(20.0, rel=0.05)
    assert friction.parameters["level"].unit == "N"
    assert "N m" not in str(sliding)
    assert "Coulomb friction of 20 N at slide" in str(sliding)


def test_nothing_is_attainable_below_the_noise_of_the_sensors(sliding: Diagnosis) -> None:
    assert all(min(o.after, o.floor) <= o.attainable <= o.after for o in sliding.outputs)


def test_a_log_without_the_joints_of_a_robot_says_how_to_hold_them_still() -> None:
    t = np.linspace(0.0, 1.0, 200)
    names = [f"{j}.{q}" for j in ("hip", "knee") for q in ("position", "velocity", "rotor_torque")]
    log = Log(t, {name: np.sin(3.0 * t) for name in names})
    with pytest.raises(
        LogError, match=r"robot\.toml:\n    lock = \['base_x', 'base_z', 'base_pitch'\]"
    ):
        diagnose(load_robot("planar_leg"), [log])
