"""What an answer says: arguments that it refuses, units, what to do now and what to record next."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.moved import moved, swing
from tests.outside import ROOT
from wbc import Robot, load_robot
from wbc.effects import EFFECTS, CoulombFriction, LoadFriction, PositionOffset, ViscousFriction
from wbc.errors import IdentificationError
from wbc.identification import Diagnosis, compare, diagnose
from wbc.identification.answer.diagnose import next_experiment
from wbc.identification.answer.diagnosis import Alternative, Finding, Verdict
from wbc.identification.answer.remainder import Remainder
from wbc.identification.answer.words import COMMAND, Commands, what_to_do
from wbc.identification.choice.certainty import Support
from wbc.identification.records.noise import NoiseFloor
from wbc.measurement import Log
from wbc.robot import Effect

LEG = load_robot("planar_leg_fixed").lossless()
TIME = np.arange(1000) * 0.005
LOG = Log(TIME, {"hip.position": np.sin(TIME), "knee.position": np.cos(TIME)})
BARE = f'name = "bare"\nmodel = "{ROOT}/robots/planar_leg/planar_leg.urdf"\n'


@pytest.mark.parametrize("what", [compare, diagnose])
@pytest.mark.parametrize(
    ("robot", "logs", "says"),
    [
        ("leg", [LOG], "not 'leg'; load it with load_robot"),
        (LEG, LOG, r"give one log as \[log\]"),
        (LEG, "run.csv", "not 'run.csv'; read files with load_logs"),
        (LEG, Path("run.csv"), "not 'run.csv'; read files with load_logs"),
        (LEG, ["run.csv"], "not 'run.csv'; read files with load_logs"),
        (LEG, 3, "logs are expected, not '3'"),
        (BARE, [LOG], r"'bare' has no gears(?s:.*)\[gears.JOINT\]"),
    ],
)
def test_what_is_no_robot_or_no_log_is_told_in_words(
    what: Callable[..., object], robot: Robot | str, logs: object, says: str, tmp_path: Path
) -> None:
    if robot is BARE:
        (tmp_path / "robot.toml").write_text(BARE)
        robot = load_robot(tmp_path / "robot.toml")
    with pytest.raises(IdentificationError, match=says):
        what(robot, logs)


def commands_in(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.startswith(COMMAND)]


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    truth = LEG.with_effect(CoulombFriction("knee", 0.4))
    return [swing(truth, 1, 0.0), swing(truth, 2, 0.0)]


@pytest.fixture(scope="module")
def found(logs: list[Log]) -> Diagnosis:
    return diagnose(LEG, logs, [CoulombFriction])


def test_the_commands_to_run_next_are_those_of_what_was_saved(found: Diagnosis) -> None:
    told = what_to_do(found, Commands(["a run.csv"], "leg.toml", saved="new.toml", lossless=True))
    # --lossless would take the losses that were found out of the corrected model again.
    assert commands_in(told) == ["wbc compare 'a run.csv' --robot new.toml"]
    assert told.endswith("Then use new.toml in place of leg.toml.")
    # With --lossless, LOG@ROBOT is read without losses; beside the corrected robot it is not.
    files = ["a.csv", "b.csv@other.toml"]
    (save,) = commands_in(what_to_do(found, Commands(files, "leg.toml", lossless=True)))
    command = "wbc diagnose a.csv b.csv@other.toml --robot leg.toml --lossless --save fitted.toml"
    assert save == command


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


@pytest.mark.usefixtures("here")
def test_in_python_the_way_out_is_a_line_of_python(found: Diagnosis) -> None:
    (line,) = commands_in(what_to_do(found))
    exec(line, {"found": found})
    assert str(load_robot("fitted.toml").effects) == str(found.robot.effects)


def test_one_word_and_one_number_for_the_noise(found: Diagnosis, logs: list[Log]) -> None:
    """ "Noise floor" and "noise of the sensors" stood for two numbers that differed by a third."""
    floor = {o.output: o.floor for o in compare(LEG, logs).outputs}
    assert {o.output: o.floor for o in found.outputs} == pytest.approx(floor)
    assert "noise floor" in str(found)
    assert "sensors" not in str(found)


FLOOR = NoiseFloor(np.eye(2), np.eye(2), ())
REPEATED = NoiseFloor(np.eye(2), np.eye(2), ((0, 1),))


def _said(effect: Effect, *alternatives: str) -> str:
    rivals = tuple(Alternative(*name.split(" at ")) for name in alternatives)
    finding = Finding(effect, {}, Support(0.5, 1.0, 0.0, 0.0, explained=True), rivals)
    return next_experiment("ambiguous", [finding], (), FLOOR, EFFECTS)


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
    assert words in _said(EFFECTS[rival].at("x"), f"{effect.name} at x")
    motion = EFFECTS[rival].experiment.partition(":")[0][1:]
    assert motion in _said(effect, f"{rival} at {effect.where}")


def test_many_rivals_ask_for_few_motions() -> None:
    said = _said(CoulombFriction("hip", 0.3), *(f"{name} at hip" for name in sorted(EFFECTS)))
    motions = said.partition("At hip: ")[2].partition(". ")[0]
    assert motions.startswith("move the joint slowly back and forth through the same positions;")
    assert motions.count("; ") == 2


def left(clue: str, elsewhere: str = "", memory: bool = False) -> Remainder:
    return Remainder("knee", 1.0, "N m", 20.0, ((clue, 0.5),), elsewhere, memory)


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
        said = next_experiment(verdict, [], [remainder], REPEATED, EFFECTS)
        assert words in said
        assert "Repeat one run exactly" not in said
        # A floor that is only a bound asks for a repeat.
        assert "Repeat one run exactly" in next_experiment(verdict, [], [remainder], FLOOR, EFFECTS)


def test_what_is_left_at_a_joint_without_a_motor_asks_for_no_motion_of_it() -> None:
    left = Remainder("shoulder", 1.0, "N m", 58383.0, (("load", 0.5),), "elbow", True, False)
    assert left.experiment.startswith("move elbow alone: what is left at shoulder")
    assert not replace(left, elsewhere="").experiment
    # A floor that cannot be is not counted in.
    assert "more than 100 times the noise floor" in left.text


@pytest.mark.parametrize("verdict", ["unknown", "partial"])
def test_drives_that_report_only_noise_come_first(verdict: Verdict) -> None:
    said = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip", "knee"))
    assert said.startswith("The drives of hip and knee report torques that do not")
    assert "constant speeds" not in said  # nothing is known of the knee
    both = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip",))
    assert both.startswith(
        "The drive of hip reports a torque that does not follow its motion, so these "
    )
    assert "Turn knee at several constant speeds" in both


def test_a_sliding_joint_is_answered_in_newtons_and_metres() -> None:
    robot, time = load_robot("emps").without_effects(), np.arange(0.0, 6.0, 1e-3)
    waves = [[(0.05 / rate, rate, rate) for rate in (2.0, 5.0, 9.0)]]
    rubbing = robot.with_effect(CoulombFriction("slide", 20.0))
    logs = [moved(rubbing, time, waves, (0.0, 0.0, 0.05), seed) for seed in (0, 1)]
    sliding = diagnose(robot, logs, [CoulombFriction, ViscousFriction])
    (friction,) = [f for f in sliding.findings if f.effect.name == "coulomb_friction"]
    assert friction.parameters["level"].value == pytest.approx(20.0, rel=0.05)
    assert friction.parameters["level"].unit == "N"
    assert "N m" not in str(sliding)
    assert "Coulomb friction of 20 N at slide" in str(sliding)
    # Nothing is attainable below the noise of the sensors.
    assert all(min(o.after, o.floor) <= o.attainable <= o.after for o in sliding.outputs)
