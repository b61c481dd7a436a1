"""The report of a diagnosis: what its page says, and that it works in a browser."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from tests.moved import swing
from tests.view.conftest import watched_tab
from wbc import load_robot
from wbc.effects import CoulombFriction, CustomTorque, LinkInertias, ViscousFriction, effect_class
from wbc.identification import (
    Alternative,
    Diagnosis,
    ErrorLevel,
    Estimate,
    Finding,
    OutputLevel,
    Step,
    Support,
    Verdict,
    diagnose,
    open_loop,
)
from wbc.identification.answer.words import VERDICTS, verdict_sentence, what_to_do
from wbc.identification.formulas import discover
from wbc.measurement import Log
from wbc.sim.excitation import record_with
from wbc.view.report import write_report

COEFFICIENT = 0.4


ROBOT = load_robot("planar_leg_fixed").lossless()


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    truth = ROBOT.with_effect(ViscousFriction("knee", COEFFICIENT))
    return [swing(truth, 1, 0.0), swing(truth, 2, 0.0), swing(truth, 3, 0.7)]


def answer() -> Diagnosis:
    """Return what is missing at the knee, and what there may be to say about it."""
    effect = ViscousFriction("knee", COEFFICIENT)
    estimate = Estimate(COEFFICIENT, "N m s/rad", 0.396, 0.404)
    support = Support(0.6, 1.0, 0.0, 0.0, explained=True)
    rivals = (Alternative("coulomb_friction", "knee"),)
    return Diagnosis(
        verdict="ambiguous",
        findings=(Finding(effect, {"coefficient": estimate}, support, rivals, ("careful",)),),
        next_experiment="Turn the knee at several constant speeds.",
        error=ErrorLevel(40.0, 1.02, 1.0, "repeats"),
        outputs=(OutputLevel("knee", "N m", 4.0, 0.1, 0.1, 0.1),),
        explained=0.999,
        steps=(Step("", "", 40.0), Step("viscous_friction", "knee", 1.02)),
        remainder="",
        robot=ROBOT.with_effect(effect),
        warnings=("the second log is short",),
    )


@pytest.fixture(scope="module")
def diagnosis(logs: list[Log]) -> Diagnosis:
    ranking = diagnose(ROBOT, logs, [ViscousFriction, CoulombFriction]).ranking
    return replace(answer(), ranking=ranking)


@pytest.fixture(scope="module")
def page(logs: list[Log], diagnosis: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    strays = [open_loop(one, logs, horizons=(0.1, 0.5)) for one in (ROBOT, diagnosis.robot)]
    how = {"command": "wbc diagnose a.csv", "simulated": strays}
    return write_report(path, ROBOT, logs, diagnosis, **how)


def test_every_verdict_has_its_sentence(diagnosis: Diagnosis) -> None:
    assert verdict_sentence(diagnosis) == (
        "It would be enough to add viscous friction of 0.4 N m s/rad at knee. But these logs "
        "cannot tell viscous friction from Coulomb friction. The corrected model explains more "
        "than 99 % of the squared error: 4.0 -> 0.10 N m at knee."
    )
    named = replace(diagnosis, verdict="named")
    assert verdict_sentence(named).startswith(
        "Missing in the model: viscous friction of 0.4 N m s/rad at knee."
    )
    rest = replace(named, outputs=(OutputLevel("knee", "N m", 4.0, 0.5, 0.3, 0.1),))
    assert verdict_sentence(rest).endswith(
        "4.0 -> 0.50 N m at knee, where the best model of the motion would leave 0.30 N m."
    )
    none = replace(diagnosis, verdict="none", findings=())
    assert verdict_sentence(none).startswith("Nothing is missing")
    partial, certain = replace(diagnosis, verdict="partial"), "Certainly missing in the model: "
    assert verdict_sentence(partial).startswith(f"{certain}viscous friction of")
    assert "turn the knee at several constant speeds." in what_to_do(partial)
    unknown = replace(diagnosis, verdict="unknown")
    said = verdict_sentence(replace(unknown, remainder="knee: 0.3 N m left."))
    assert said.startswith(f"{certain}viscous friction")
    assert said.endswith("No known effect explains the rest: 0.10 N m are left at knee.")
    assert "No known effect" not in verdict_sentence(replace(unknown, remainder=""))
    assert "no known effect explains (0.10 N m" in verdict_sentence(replace(unknown, findings=()))
    doubted = replace(diagnosis.findings[0].support, odds=0.1, group=0.1)
    tiny = tuple(replace(finding, support=doubted) for finding in diagnosis.findings)
    several = replace(unknown, findings=tiny, trait="0.5 N m at knee, which follows speed (80 %)")
    said = verdict_sentence(several)
    assert said.startswith("Something is missing in the model, and no cause of it is certain.")
    assert "Together they add 0.5 N m at knee, which follows speed" in said
    assert re.search("at knee +0.400 +N m s/rad +doubtful\n +left", str(several))
    apart = OutputLevel("knee", "N m", 0.5, 0.5, 0.5, 0.42, excess=6.1)
    torn = replace(diagnosis, verdict="not_repeatable", outputs=(*diagnosis.outputs, apart))
    assert verdict_sentence(torn) == (
        "Runs that repeat one another disagree: by 0.42 N m at knee, 6.1 times what the noise of "
        "their sensors explains. So nothing can be named from these logs."
    )
    said = str(diagnosis)
    assert re.search(
        r"viscous_friction at knee +0.400 .*60 % sure\n +or coulomb_friction +> 99 %", said
    )
    assert re.search(r"knee +4.0 +0.10 +0.10 +0.10 +N m", said)


def test_what_a_reader_who_knew_nothing_did_not_understand_is_said(
    page: Path, diagnosis: Diagnosis
) -> None:
    """He read a report; each line here is a point of his list."""
    text = page.read_text(encoding="utf-8")
    seen = text[: text.index("<script>")]
    # The verdict in words, the robot's name with what it means ("fixed" was read as repaired).
    assert ">likely, not certain</span>" in seen
    assert VERDICTS.keys() == set(get_args(Verdict))
    assert "planar_leg_fixed (fixed base)" in seen
    # Two kinds of certainty say what they are about.
    assert "60\u00a0% sure</span> that it is there" in seen
    assert "90&nbsp;% interval: 0.396 … 0.404" in seen
    # A title begins with a capital.
    assert "<h3>Viscous friction <" in seen
    # One word for the noise floor, and one number: the limit that everything is measured by.
    assert "noise of the sensors</th>" not in seen
    # Effects that are named are explained; squared units and words of the method are gone.
    words = seen[seen.index("What these effects are") :]
    assert "<dt>Coulomb friction</dt>" in words
    assert "Surfaces rub" in words
    assert not re.search("floors²|linear estimate|ot needed", seen)
    # No number is parted from its unit at the end of a line.
    assert not re.search(r"\d %|\d N m", re.sub(r"<style>.*?</style>|<code>.*?</code>", "", seen))
    # What the motion hides is shaded, in the plots over time.
    data = json.loads(re.search(r'<script id="data".*?>(.*?)</script>', text, re.S)[1])
    for panel in data["panels"]:
        run = panel["runs"][0]
        assert run["unused"]
        assert all(run["t"][0] <= start <= end <= run["t"][-1] for start, end in run["unused"])


def test_a_sentence_holds_no_more_than_four_causes_the_certain_first(diagnosis: Diagnosis) -> None:
    """The recorded TX40 was told in a sentence of six lines, with a spring of 76 % among them."""
    names = ("coulomb_friction", "quadratic_drag", "joint_spring", "rotor_inertia", "torque_offset")
    sure = (0.76, 0.97, 0.97, 0.97, 0.97)
    findings = tuple(
        Finding(effect_class(name).at("knee"), {}, Support(p, p, 0.0, 0.0, explained=True))
        for name, p in zip(names, sure, strict=True)
    )
    said = verdict_sentence(replace(diagnosis, verdict="named", findings=findings))
    assert said.startswith("Missing in the model: quadratic drag")
    assert "rotor inertia of" in said
    assert " at knee. Likely: Coulomb friction of" in said
    both = verdict_sentence(replace(diagnosis, verdict="ambiguous", findings=findings))
    assert both.index("rotor inertia") < both.index(" and 2 more causes.")
    assert "more causes" not in said


def test_a_drive_that_was_set_aside_is_not_the_measure_of_an_answer(diagnosis: Diagnosis) -> None:
    """The recorded TIAGo: "That explains 88 % of the squared error: 181 -> 181 N"."""
    torso = OutputLevel("torso", "N", 181.0, 181.0, 181.0, 0.094, judged=False)
    arm = OutputLevel("arm", "N m", 5.0, 1.2, 1.1, 0.6)
    wrist = OutputLevel("wrist", "N m", 9.0, 8.9, 1.0, 0.6)
    found = replace(diagnosis, verdict="partial", outputs=(torso, wrist, arm))
    assert ": 5.0 -> 1.2 N m at arm. One cause that is in no list" in verdict_sentence(found)
    rest = replace(found, remainder="wrist: 8.9 N m left.")
    assert "at arm. No known effect explains the rest: 8.9 N m" in verdict_sentence(rest)
    unknown = replace(found, verdict="unknown", findings=())
    assert "(8.9 N m are left at wrist)" in verdict_sentence(unknown)
    assert re.search(r"torso +181 +181 +181 +0\.094 +N, set aside", str(found))
    assert found.to_json()["joints"]["torso"]["judged"] is False


def test_a_drawing_without_a_number_that_is_told_shows_none(diagnosis: Diagnosis) -> None:
    """The recorded TX40 listed 60 log-Cholesky numbers of its links, most of them 1e-11."""
    null = LinkInertias.null_values(load_robot("planar_leg_fixed"), "robot")
    drawn = LinkInertias.at("robot", {name: 0.01 for name in null})
    numbers = {name: Estimate(0.01, "1", -0.01, 0.02) for name in null}
    wrong = Finding(drawn, numbers, Support(1.0, 1.0, 0.0, 0.0, explained=True))
    one = replace(diagnosis, verdict="named", findings=(wrong,))
    assert verdict_sentence(one).startswith(
        "Missing in the model: link inertias at robot. The corrected model explains"
    )
    assert "alpha" not in str(one)


def test_the_file_holds_every_part_and_asks_no_network(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert page.stat().st_size < 10_000_000
    assert not re.search(r'<(script|link|img|iframe)[^>]+(src|href)="(?!data:)', text)
    answer, others = ("next", "left", "effects", "where"), ("open-loop", "ambiguity", "motion")
    more = ("signals", "staircase", "ranking", "quality", "provenance")
    for part in (*answer, *others, *more):
        assert f'id="{part}"' in text
    # Every word that the page needs is explained where it first stands.
    assert "its name is not certain" in text  # the verdict: ambiguous
    for word in ("Noise floor", "Attainable", "sure", "90&nbsp;% interval", "Odds"):
        assert f"<b>{word}</b>" in text
    places = [text.index(f'id="{part}"') for part in (*answer, "ranking")]
    marks = set(re.findall(r'class="dot (\w+)"', text))
    assert marks >= {"line", "before", "unused"}
    assert all(f".dot.{mark} " in text for mark in marks)  # of the legend: each has a colour
    assert places == sorted(places)  # the answer comes first, what else was tried after it
    for words in (
        "after 0.5\u00a0s",
        "0.400&nbsp;N\u00a0m\u00a0s/rad",
        "0.396 … 0.404",
        "careful",
        "the second log is short",
        "wbc diagnose a.csv",
        "urn the knee at several constant speeds.",  # within a sentence, or at its start
    ):
        assert words in text


def test_paired_differences_tell_the_effect_from_none_and_from_its_rival(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    table = text[text.index('id="ranking"') : text.index('id="quality"')]
    rows = [
        [re.sub("<.*?>", "", cell).strip() for cell in re.findall("<td.*?</td>", row)]
        for row in re.findall("<tr.*?</tr>", table, re.S)[1:]
    ]
    verdicts = {row[0]: row[2] for row in rows}
    assert rows[0][0] == "what was found"
    assert verdicts["what was found"] == "found"
    given, rival = "without viscous friction at knee", "Coulomb friction at knee instead of viscous"
    rival = next(name for name in verdicts if name.startswith(rival))
    assert verdicts[given] == verdicts[rival] == "fits worse"
    errors = {row[0]: float(row[1]) for row in rows}
    assert errors[given] > errors[rival] > 2.0 * errors["what was found"]
    difference, deviation = (float(part) for part in rows[-1][4].split(" ± "))
    assert rows[-1][0] == given
    assert difference == pytest.approx(errors[given] - errors["what was found"], rel=0.05)
    assert 0.0 < deviation < difference


def test_names_from_files_cannot_break_out_of_the_page(logs: list[Log], tmp_path: Path) -> None:
    source = replace(logs[0].source, path='<script>alert("x")</script>.csv')
    page = write_report(tmp_path / "compare.html", ROBOT, [replace(logs[0], source=source)])
    text = page.read_text(encoding="utf-8")
    assert '<script>alert("x")' not in text
    assert "misses these logs by" in text


def test_the_page_works_in_a_browser(page: Path, browser: Any) -> None:
    tab = watched_tab(browser, 1100, 900)
    tab.goto(page.as_uri())
    tab.wait_for_function("window.report && window.report.ready")
    plots = tab.locator("#panels .plot.js-plotly-plot")
    assert plots.count() == 10

    hidden = tab.locator("#panels details").nth(1)
    hidden.locator("summary").click()
    assert not hidden.locator(".plot").first.is_visible()
    hidden.locator("summary").click()
    assert hidden.locator(".plot").first.is_visible()

    plot = plots.first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait_for_selector(".hoverlayer .hovertext")
    before = plot.evaluate("e => e.layout.xaxis.range.slice()")
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.5 * box["height"], steps=5)
    tab.mouse.up()
    tab.wait_for_function(
        "w => document.querySelector('#panels .plot').layout.xaxis.range[0] > w", arg=before[0]
    )

    page_colour = "getComputedStyle(document.body).backgroundColor"
    light = tab.evaluate(page_colour)
    tab.click("#theme")
    assert tab.evaluate(page_colour) != light

    tab.locator("#playback").scroll_into_view_if_needed()
    frame = tab.locator("#playback").element_handle().content_frame()
    frame.wait_for_function("window.player")
    frame.evaluate("player.seek(3.0)")
    assert frame.evaluate("player.time") == pytest.approx(3.0)
    assert frame.evaluate("document.documentElement.dataset.theme") == "dark"

    # The signals beside the playback follow it, and a click on them moves it.
    line = tab.locator("#signal-residual .cursor")
    tab.wait_for_function("!document.querySelector('#signal-residual .cursor').hidden")
    middle = line.bounding_box()["x"]
    frame.evaluate("player.seek(1.0)")
    tab.wait_for_function(
        "x => document.querySelector('#signal-residual .cursor').getBoundingClientRect().x < x",
        arg=middle,
    )

    tab.emulate_media(media="print")
    tab.evaluate("report.toPaper()")
    assert tab.locator("details:not([open])").count() == 0
    assert tab.evaluate("document.documentElement.dataset.theme") == "light"
    assert tab.locator("#shown").inner_text() == "log in memory"
    # On paper the heading of a box stood on the box's blue line.
    box, head = (tab.locator(f"#ambiguity{e}").bounding_box()["x"] for e in ("", " h2"))
    assert head - box > 12.0
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    tab.emulate_media(media="screen")

    # Plots keep within their places while the window narrows.
    wide = "[...document.querySelectorAll('.plot')].filter(e => e.querySelector('svg') && "
    wide += "e.querySelector('svg').clientWidth > e.parentElement.clientWidth + 1).length"
    for width in (700, 390):
        tab.set_viewport_size({"width": width, "height": 800})
        tab.wait_for_function(f"{wide} === 0", timeout=30000)
    # Logs have long names.
    tab.evaluate("document.querySelector('#motion h2').textContent = 'run_'.repeat(30)")
    tab.wait_for_function("document.documentElement.scrollWidth <= 390", timeout=5000)
    # The names of what the residual depends on stood in a column of one word.
    name = "Math.min(...[...document.querySelectorAll('.bars td:nth-child(2)')].map("
    assert tab.evaluate(f"{name}e => e.clientWidth))") > 120
    cut = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth)"
    assert tab.evaluate(f"{cut}.map(e => e.closest('section').id)") == []
    assert tab.troubles == []


def test_lines_to_copy_stand_on_lines_of_their_own(tmp_path: Path) -> None:
    """A report ran the lines of two column maps into one sentence."""
    late = swing(ROBOT, 1)
    slow = {name: np.roll(values, 1) for name, values in late.columns.items() if "vel" in name}
    report = write_report(tmp_path / "a.html", ROBOT, [late.with_columns(slow)], command="x")
    page = report.read_text(encoding="utf-8")
    assert re.search(r'<span class="soft lines">[^<]*\n *time.align_velocity = true\n', page)
    assert ".lines { white-space: pre-line; }" in page


def test_a_proposed_formula_stands_in_the_report_with_its_numbers(tmp_path: Path) -> None:
    logs = record_with(ROBOT, [CustomTorque.at("knee", {"sin(2 q_hip)": -0.8})], duration=2.0)
    diagnosis = diagnose(ROBOT, logs, [ViscousFriction])
    discovery = discover(ROBOT, logs, known=diagnosis.effects)
    (proposal,) = discovery.proposals
    page = write_report(tmp_path / "r.html", ROBOT, logs, diagnosis, discovery=discovery)
    text = page.read_text(encoding="utf-8")
    section = text.partition('<section id="formulas">')[2].partition("</section>")[0]
    assert "sin(2 q_hip)" in section
    assert discovery.summary in section
    (estimate,) = proposal.coefficients.values()
    assert np.isclose(estimate.value, -0.8, rtol=0.02)
    assert f"{abs(estimate.value):.3f}"[:4] in section
