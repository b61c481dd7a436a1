"""The page in a real browser, opened as a file: what its buttons do and what it never asks for."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb as rgb

from tests.view.conftest import watched_tab
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view import model_ghost, write_playback
from wbc.view.palette import BLUE, GREY, RESIDUAL_OVER, RESIDUAL_UNDER, VERMILION, YELLOW

# The page's clock is in the test's hand: a frame is drawn when `pump` is called.
CLOCK = """
window.waiting = []; window.stamp = 0;
window.requestAnimationFrame = (f) => window.waiting.push(f);
window.pump = (ms) => {
  stamp += ms; const now = waiting; waiting = []; now.forEach((f) => f(stamp));
};
"""


@pytest.fixture(scope="module")
def page(leg: Robot, squat: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a playback whose ghost has residuals of both signs."""
    ghost = model_ghost(leg, squat.between(0.3, 1.9), label="believed")
    time = ghost.residual_time
    residual = {"hip": 20.0 * np.ones_like(time), "knee": -20.0 * np.ones_like(time)}
    path = tmp_path_factory.mktemp("player") / "squat.html"
    return write_playback(path, leg, squat, ghost=replace(ghost, residual=residual))


def opened(page: Path, browser: Any) -> Any:
    """Return a tab with a playback that waits for its clock."""
    tab = watched_tab(browser, 1000, 700)
    tab.context.set_offline(True)
    tab.add_init_script(CLOCK)
    tab.goto(page.as_uri())
    tab.evaluate("pump(0), pump(0)")
    tab.wait_for_function("() => window.player", polling=50)
    tab.evaluate("player.setPlaying(false)")
    return tab


@pytest.fixture(scope="module")
def tab(page: Path, browser: Any) -> Any:
    return opened(page, browser)


def colour_of(tab: Any, *path: str) -> list[float]:
    return tab.evaluate("path => player.colour(path)", list(path))


@pytest.mark.parametrize("speed", ["0.05", "0.25", "1", "4"])
def test_the_speed_chosen_is_the_speed_shown(tab: Any, speed: str) -> None:
    tab.evaluate("player.setPlaying(false), player.seek(0.2)")
    tab.select_option("#speed", speed)
    tab.click("#play")
    tab.evaluate("pump(1)")
    before = tab.evaluate("player.time")
    tab.evaluate("pump(100)")
    assert tab.evaluate("player.time") - before == pytest.approx(0.1 * float(speed), abs=1e-6)
    tab.click("#play")


def test_a_small_negative_number_is_no_minus_zero(tab: Any) -> None:
    tab.evaluate("player.seek(0.02)")  # in the air: no torque, no power
    table = tab.inner_text("#gears")
    assert "+0.0" in table
    assert "−0.0" not in table


def test_a_printed_playback_shows_all_of_the_scene(tab: Any) -> None:
    shown = tab.viewport_size
    tab.emulate_media(media="print")
    tab.set_viewport_size({"width": 700, "height": 900})
    ends = "() => document.querySelector('#pane canvas').getBoundingClientRect().right"
    assert tab.evaluate(ends) <= 700
    assert not tab.is_visible("#bar")
    size = "document.querySelector('#pane canvas').toDataURL().length"
    printed = f"() => {{ dispatchEvent(new Event('beforeprint')); return {size}; }}"
    assert tab.evaluate(printed) > 2 * tab.evaluate(f"() => {size}")  # empty between frames
    tab.emulate_media(media="screen")
    tab.set_viewport_size(shown)


def test_buttons_and_keys_step_by_frames(tab: Any) -> None:
    tab.evaluate("player.seek(0.5)")
    frame = "document.getElementById('clock').textContent.match(/frame (\\d+)/)[1]"
    first = int(tab.evaluate(frame))
    tab.click("#next")
    assert int(tab.evaluate(frame)) == first + 1
    tab.keyboard.press("ArrowLeft")
    tab.keyboard.press("Shift+ArrowRight")
    assert int(tab.evaluate(frame)) == first + 10
    tab.keyboard.press("End")
    assert tab.evaluate("player.time === player.stop")


def test_the_next_mark_is_the_impact_and_its_force_shows_with_its_cone(
    tab: Any, squat: Log
) -> None:
    tab.evaluate("player.seek(0)")
    assert tab.inner_text("#mark") == "next impact"
    tab.click("#mark")
    landing = squat.time[np.argmax(squat.column("foot.force.z") > 0.0)]
    assert tab.evaluate("player.time") == pytest.approx(landing, abs=1.0 / 60.0)
    note = tab.inner_text("#note")  # impact of foot, 9... N at ... s
    assert note.startswith("impact of foot, 9")
    assert tab.evaluate("player.visible(['contacts', 'foot', 'shaft'])")
    assert colour_of(tab, "contacts", "foot", "cone") == pytest.approx(rgb(YELLOW), abs=0.01)
    # The force stands at its arrow as a number.
    label = tab.locator(".force")
    assert label.inner_text() == f"{note.split(', ')[1].split(' at')[0]} (arrow cut)"
    box = label.bounding_box()
    assert min(box["x"], box["y"]) >= 0.0
    assert box["x"] + box["width"] <= 1000.0
    assert "force arrow: " in tab.locator("#legend").text_content()
    tab.get_by_label("forces").uncheck()
    assert not label.is_visible()
    tab.get_by_label("forces").check()


@pytest.mark.parametrize("size", [(1000, 700), (560, 560), (390, 800), (1400, 400)])
def test_the_camera_fills_what_the_card_leaves_free_with_the_robot(
    tab: Any, size: tuple[int, int]
) -> None:
    """In the report's window the card hid the robot."""
    tab.set_viewport_size({"width": size[0], "height": size[1]})
    tab.evaluate("window.dispatchEvent(new Event('resize')), pump(20), player.frameCamera()")
    points = np.array(tab.evaluate("player.framedPoints()"))
    window = tab.locator("#pane").bounding_box()
    card = tab.locator("#card").bounding_box()
    corner = np.array([card["x"] + card["width"], card["y"] + card["height"]])
    whole = np.array([window["width"], window["height"]])
    assert np.all(points > 0.0)
    assert np.all(points < whole)
    assert not np.any(np.all(points < corner, axis=1))
    free = [whole, whole - [corner[0], 0.0], whole - [0.0, corner[1]]]
    # The border of 6 % is of the nearest depth: what lies behind reaches a little less far.
    filled = [float(np.max(np.ptp(points, axis=0) / part)) for part in free]
    assert any(0.85 < share <= 1.0 for share in filled)
    tab.set_viewport_size({"width": 1000, "height": 700})


def test_the_frame_button_finds_a_robot_that_went_away(
    browser: Any, leg: Robot, squat: Log, tmp_path: Path
) -> None:
    """It framed the place where the motion began, and an empty window was left."""
    away = squat.column("base_x.position") + 5.0 * squat.time / squat.time[-1]
    walk = squat.with_columns({"base_x.position": away})
    other = opened(write_playback(tmp_path / "walk.html", leg, walk), browser)
    for followed in (True, False):
        other.get_by_label("follow").set_checked(followed)
        other.evaluate("player.seek(1.9)")
        other.click("#frame")
        assert max(map(abs, other.evaluate("player.middle()"))) < 0.7
        if followed:  # also to the next instant that is asked for: a film lost the way to its start
            other.evaluate("player.frameCamera(), player.seek(0.1)")
            assert max(map(abs, other.evaluate("player.middle()"))) < 0.7
    other.close()


def test_joints_take_the_colour_of_power_or_of_the_residual(tab: Any, leg: Robot) -> None:
    hubs = {name: ("robot", f"j{leg.model.getJointId(name)}", "hub") for name in ("hip", "knee")}
    tab.evaluate("player.seek(0.45)")
    assert colour_of(tab, *hubs["hip"]) == pytest.approx(rgb(RESIDUAL_OVER), abs=0.01)
    assert colour_of(tab, *hubs["knee"]) == pytest.approx(rgb(RESIDUAL_UNDER), abs=0.01)
    tab.get_by_label("residual").uncheck()
    shown = {}
    for instant in (0.05, 0.45, 1.1):
        tab.evaluate("t => player.seek(t)", instant)
        shown[instant] = tab.inner_text("#gears tr:last-child .chip")
        colours = {"stuck or idle": GREY, "joint drives": VERMILION, "motor drives": BLUE}
        expected = rgb(colours[shown[instant]])
        assert colour_of(tab, *hubs["knee"]) == pytest.approx(expected, abs=0.01)
    assert shown == {0.05: "stuck or idle", 0.45: "joint drives", 1.1: "motor drives"}
    # A badge says what the legend says.
    legend = tab.inner_text("#legend")
    assert [word for word in shown.values() if word not in legend] == []
    tab.get_by_label("residual").check()


def test_what_is_unchecked_is_hidden(tab: Any) -> None:
    tab.evaluate("player.seek(0), document.getElementById('mark').click()")
    for box, path in (("ghost", ["ghost"]), ("cones", ["contacts", "foot", "cone"])):
        for shown in (False, True):
            tab.get_by_label(box).set_checked(shown)
            assert tab.evaluate("path => player.visible(path)", path) == shown


def test_a_phone_shows_it_too_and_nothing_was_asked_of_the_network(tab: Any) -> None:
    tab.set_viewport_size({"width": 390, "height": 800})
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert tab.evaluate("document.documentElement.scrollHeight") <= 800
    tab.click("#theme")
    assert tab.troubles == []
