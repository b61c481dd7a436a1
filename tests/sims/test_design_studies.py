"""The studies of choosing a gearbox: the numbers that the page about it states."""

from itertools import combinations

import numpy as np
import pytest

from sims import case_study, energy_flow, topologies, wedge, wedge_forces


def test_case_study() -> None:
    found = case_study.main()
    shares = found["directions"]
    assert shares["all gears drive forward [% of forces]"] == pytest.approx(57.0, abs=0.5)
    assert shares["a gear stands still [% of forces]"] == pytest.approx(25.0, abs=0.5)
    assert shares["exact over Forward-GIT, most"] == pytest.approx(1.21, abs=0.005)
    factors = found["impact mitigation"]
    # From the reference numbers of the design: 0.888639 without losses, 0.863972 with them.
    assert factors["perfect gears"] == pytest.approx(0.888639, abs=1e-6)
    assert factors["gears set in motion (backward)"] == pytest.approx(0.863972, abs=1e-6)
    assert factors["gears slowed down (forward)"] > factors["perfect gears"]
    eta = np.array([0.55, 0.7, 0.9])
    follows, apart = case_study.efficiencies(eta), case_study.efficiencies(eta, np.full(3, 0.9))
    np.testing.assert_allclose(follows.lift, apart.lift)  # lift knows eta_f alone
    assert np.ptp(apart.hold) == pytest.approx(0.0, abs=1e-9)  # hold and IMF know eta_b alone
    assert np.ptp(apart.impact_mitigation) == pytest.approx(0.0, abs=1e-12)
    worse, higher, lossy = case_study._ways(np.linspace(0.505, 1.0, 200)).values()
    for x, y, expected in ((*worse, 0.80), (*higher, 0.57)):
        rising = np.argsort(x)
        found_at = np.interp(400.0, np.asarray(x)[rising], np.asarray(y)[rising])
        assert found_at == pytest.approx(expected, abs=0.005)
    assert np.interp(400.0, *lossy) < 0.7
    files = case_study.report(found)
    assert [path.read_bytes()[:4] for path in files] == [b"\x89PNG"] * 2


def test_topologies() -> None:
    table = topologies.main()
    serial, parallel = table["serial"], table["parallelogram"]
    share = "directions driven forward by both [%]"
    assert parallel[share] > 90.0 > serial[share]
    # The knee bears the same; in series the hip bears nothing under a foot straight below it.
    assert serial["holding the weight, hip [N m]"] == pytest.approx(0.0, abs=1e-9)
    knee = "holding the weight, knee [N m]"
    assert parallel[knee] == pytest.approx(serial[knee])
    assert parallel["holding heat [W]"] > 2.5 * serial["holding heat [W]"]
    for leg in table.values():
        assert leg["effective mass up, lossless [kg]"] < leg["effective mass up, pushed [kg]"]


def test_energy_flow() -> None:
    found = energy_flow.main(duration=2.0)
    for rows in found.values():
        assert sum(rows.values()) == pytest.approx(0.0, abs=1e-9)
        assert abs(rows["unexplained"]) < 0.01 * rows["supply"]
        assert rows["Joule heat"] < 0.0
        assert rows["back to the supply"] <= 0.0
        assert energy_flow.staged(rows)["ground"] == pytest.approx(0.0, abs=1e-9)
    squat, landing = found["squat"], found["landing"]
    assert energy_flow.staged(squat)["motors"] > 0.0 > energy_flow.staged(landing)["gears"]
    assert squat["Joule heat"] < squat["teeth of the gears"]  # both negative: more heat in windings
    assert landing["fall"] > 0.0
    assert landing["impact, in the ground"] < 0.0
    assert energy_flow.report(found)[0].read_bytes()[:4] == b"\x89PNG"


def test_wedge() -> None:
    curves = wedge.main()
    forces = curves["forces"]
    np.testing.assert_allclose(forces["driven"] + forces["back-driven"], 2.0)
    lines = [force[1:] for name, force in forces.items() if name != "k"]
    for one, other in combinations(lines, 2):  # no curve lies on another
        assert np.all(one != pytest.approx(other, abs=1e-6))
    rubbing, smooth = curves["mu = 0.4"], curves["mu = 0"]
    assert np.isnan(rubbing["backward"][-1])  # locks itself
    assert np.all(rubbing["forward"] >= smooth["forward"])
    assert wedge.report(curves)[0].read_bytes()[:4] == b"\x89PNG"


def test_wedge_forces() -> None:
    found = wedge_forces.main()
    forward, backward = found["forward"], found["backward"]
    for rows in found.values():  # along the slope all forces on the wedge balance
        pressed = rows["lambda"] * np.cos(wedge_forces.ALPHA)
        rubbed = rows["friction"] * np.sin(wedge_forces.ALPHA)
        assert rows["f_u"] == pytest.approx(pressed + rubbed)
    power = {way: rows["f_u"] / np.cos(wedge_forces.ALPHA) for way, rows in found.items()}
    assert forward["f_x"] / power["forward"] == pytest.approx(forward["efficiency"])
    assert power["backward"] / backward["f_x"] == pytest.approx(backward["efficiency"])
    picture, film = wedge_forces.report(found, frames=3)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert film.read_bytes()[:4] == b"GIF8"
