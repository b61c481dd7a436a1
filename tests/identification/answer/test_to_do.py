"""What to do now: whole commands that run as printed, and what of the robot is to be touched."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.swinging_leg import swing
from wbc import load_robot
from wbc.effects import CoulombFriction
from wbc.identification import Diagnosis, compare, diagnose
from wbc.identification.answer.words import COMMAND, Commands, what_to_do
from wbc.measurement import Log

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
