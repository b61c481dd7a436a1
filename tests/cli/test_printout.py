"""What a command prints: the answer first, a screen of detail, all of it when asked."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from tests.cli.conftest import LEG
from tests.conftest import Told
from tests.view.report.test_report import answer
from wbc.cli import main
from wbc.cli.models import print_diagnosis
from wbc.effects import CoulombFriction
from wbc.identification import Diagnosis, Estimate, Ranked, Step
from wbc.identification.open_loop import OpenLoop
from wbc.tables import TextTable


@pytest.fixture(scope="module")
def long_answer() -> Diagnosis:
    """A robot of thirty joints about which there is much to say."""
    joints, one, findings = [f"joint_{k}" for k in range(30)], answer(), []
    for joint in joints[:12]:
        effect, level = CoulombFriction(joint, 0.5), Estimate(0.5012, "N m", 0.48, 0.52)
        said = f"level is hardly identifiable at {joint}: 0.1 to 9 N m; move it faster and further"
        parts = {"effect": effect, "parameters": {"level": level}, "warnings": (said,)}
        findings.append(replace(one.findings[0], **parts))
    return replace(
        one,
        verdict="named",
        findings=tuple(findings),
        outputs=tuple(replace(one.outputs[0], output=joint) for joint in joints),
        steps=tuple(Step("coulomb_friction", joint, 30.0) for joint in joints[:12]),
        warnings=tuple(f"the log run{k}.csv is short" for k in range(20)),
        ranking=tuple(
            Ranked((("backlash", joint),), (), 2.0, 3.0, 0.1, -20.0, "worse") for joint in joints
        ),
    )


def printed(diagnosis: Diagnosis, **how: bool) -> list[str]:
    file = StringIO()
    print_diagnosis(Console(file=file, width=80), diagnosis, **how)
    return file.getvalue().splitlines()


def test_the_answer_comes_first_and_fits_a_screen(long_answer: Diagnosis) -> None:
    usual = printed(long_answer)
    assert usual[0] == "verdict: named (these logs tell which effects the model lacks)"
    # One effect at many places is said once: it was a headline of seventeen lines.
    assert usual[1].startswith(
        "Missing in the model: Coulomb friction at 12 places (0.50 N m). The corrected"
    )
    assert len(usual) < 57  # and three files written: below 60
    assert "not shown: the rest of what was found, what is left" in "\n".join(usual)
    everything = printed(long_answer, verbose=True)
    assert len(everything) > 150
    assert sum("backlash at joint_" in line for line in everything) == 30
    quiet = printed(long_answer, quiet=True)
    assert quiet == usual[: len(quiet)]
    assert "fitted.toml" in quiet[-1] + quiet[-2]


def test_quiet_commands_print_the_answer_alone(
    rubbing: list[str], told: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = told("compare", *rubbing, *LEG, "--quiet")
    assert shown.startswith("The model misses these logs by 0.6")
    assert "N m at hip" in shown
    assert "where it fails" not in shown
    assert main(["check", *rubbing, "--robot", "planar_leg_fixed", "--quiet"]) == 0
    remarks = capsys.readouterr().out.splitlines()
    assert len(remarks) == 1
    assert "below" not in remarks[0]
    with pytest.raises(SystemExit):
        main(["check", *rubbing, "--robot", "planar_leg_fixed", "--quiet", "--verbose"])


def test_numbers_are_as_deep_as_they_are_known() -> None:
    from wbc.identification.answer.shown import plain, told, with_deviation, with_interval

    # A reader of a report found 0.8003 (0.8000 … 0.8006) too many digits.
    assert with_interval(0.80028, 0.79995, 0.8006) == ("0.800", "0.800 … 0.801")
    assert with_interval(0.5010, 0.4996, 0.5022) == ("0.501", "0.500 … 0.502")
    # Never so few that the interval becomes a point, or much wider than it is.
    assert with_interval(0.345, 0.3449, 0.3451) == ("0.3450", "0.3449 … 0.3451")
    assert with_interval(30.0, 12.0, 55.0)[0] == "30"
    # Friction of a recorded arm was printed as 0.1 (0.0 … 0.1).
    assert with_interval(0.0699, 0.0412, 0.0986) == ("0.070", "0.041 … 0.099")
    assert with_interval(0.143, 0.118, 0.168) == ("0.14", "0.12 … 0.17")
    # A number that logs do not tell was printed with 110 digits.
    assert with_interval(1.0, -1e110, 1e110) == ("1.000", "−1.000e+110 … 1.000e+110")
    assert plain(np.nan) == "–"
    assert [told(x) for x in (8.1e-8, 0.0079, 2e3)] == ["0", "0.0079", "lost"]
    # A difference has the digits that its standard error leaves: it was +96016 ± 12635.
    assert with_deviation(96016.3, 12635.1) == "+96,000 ± 13,000"
    assert with_deviation(-12.6, 102.4) == "−10 ± 100"
    assert with_deviation(9.7e6, 651798.0) == "+9,700,000 ± 650,000"
    assert with_deviation(0.01234, 0.00456) == "+0.0123 ± 0.0046"
    assert with_deviation(-0.3, 99.0) == "0 ± 99"
    assert with_deviation(0.5, 0.0) == "+0.500 ± 0"
    # The demo printed +0.0000000000002 ± 0.0000000000016.
    assert with_deviation(2e-13, 1.6e-12) == "+2.0e−13 ± 1.6e−12"


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_commands_answer_before_they_simulate(
    command: str,
    rubbing: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first simulation waits a minute for the compiler."""

    def stop(*_: object, until: float) -> OpenLoop:
        raise LookupError

    monkeypatch.setattr("wbc.cli.models.open_loop", stop)
    asked = [command, *rubbing, *LEG]
    asked += ["--add", "coulomb_friction"] if command == "diagnose" else []
    with pytest.raises(LookupError):
        main(asked)
    said = capsys.readouterr().out
    assert "hip" in said and "0.7" in said if command == "diagnose" else "hip" in said
    assert main([*asked, "--quiet"]) == 0


def test_names_that_begin_alike_are_told_apart() -> None:
    """Joints of a recorded arm were all called AR5-5_07R-W4C4…; the numbers at their ends went."""
    names = [f"AR5-5_07R-W4C4A2_joint_{k}" for k in range(1, 8)]
    rows = [(name, "load against direction", "N m", "94 %", "-0.2 at -0.092") for name in names]
    shown = StringIO()
    Console(file=shown, width=60).print(TextTable.of("output|on|unit|>share|>from", rows))
    assert "…" not in shown.getvalue()
    ends = [line.split()[0] for line in shown.getvalue().splitlines() if "_joint_" in line]
    assert [end[-1] for end in ends] == [name[-1] for name in names]
