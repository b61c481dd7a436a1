"""A recording made by hand: the planar leg drops, lands and squats."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
from tests.moved import exact_log
from wbc.measurement import Log
from wbc.robot import Motion, Robot
from wbc.view import write_playback

DROP = 0.05
STEP = 2e-3
LANDING = float(np.sqrt(2.0 * DROP / 9.81))


@pytest.fixture(scope="session")
def leg() -> Robot:
    return wbc.load_robot("planar_leg")


@pytest.fixture(scope="session")
def squat(leg: Robot) -> Log:
    """Two seconds: free fall of 5 cm with the leg bent, an impact, then a squat by 8 cm."""
    time = np.arange(0.0, 2.0, STEP)
    stance = np.clip(time - LANDING, 0.0, None)
    length = 0.66 - 0.04 * (1.0 - np.cos(2.0 * np.pi * stance / 1.2))
    fall = np.where(time < LANDING, DROP - 0.5 * 9.81 * time**2, 0.0)
    knee = -2.0 * np.arccos(length / 0.8)
    hip = -0.5 * knee
    rest = np.zeros_like(time)
    joints = {"base_x": rest, "base_z": length + fall, "base_pitch": rest, "hip": hip, "knee": knee}
    q = np.stack(list(joints.values()), axis=1)
    v = np.gradient(q, time, axis=0)
    a = np.gradient(v, time, axis=0)
    landing = int(np.searchsorted(time, LANDING))
    v[landing - 1 : landing + 1, 1] = -9.81 * LANDING
    a[landing - 2 : landing + 3] = 0.0
    mass = 19.0
    vertical = np.where(time < LANDING, 0.0, mass * (9.81 + a[:, 1]))
    vertical[landing : landing + 3] = [900.0, 500.0, 250.0]
    force = np.stack([0.05 * vertical, np.zeros_like(time), vertical], axis=1)
    return exact_log(leg, Motion(q, v, a, time=time), {"foot": force})


@pytest.fixture(scope="session")
def page(leg: Robot, squat: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The playback of the recording."""
    path = tmp_path_factory.mktemp("view") / "squat.html"
    return write_playback(path, leg, squat, marks={"squat": 0.7})


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Any]:
    """A browser of one file: pictures cannot be taken beside it."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    flags = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
    flags += ["--enable-unsafe-swiftshader", "--disable-background-networking"]
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=flags)
        yield browser
        browser.close()


def watched_tab(browser: Any, width: int, height: int) -> Any:
    """Return a tab whose `troubles` are errors of its page and what it asks of the network."""
    tab = browser.new_page(viewport={"width": width, "height": height})
    tab.troubles = []
    tab.on("console", lambda m: tab.troubles.append(m.text) if m.type == "error" else None)
    tab.on("pageerror", lambda error: tab.troubles.append(str(error)))
    ours = ("file:", "data:", "blob:")
    tab.on("request", lambda r: r.url.startswith(ours) or tab.troubles.append(r.url))
    return tab


@pytest.fixture(scope="session")
def chromium() -> str:
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("no chromium on the PATH (Debian: apt-get install chromium)")
    return path
