"""The commands: what they print, write and return, and how they refuse bad input."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess

import numpy as np
import pytest

from wbc import load_robot
from wbc.cli import main
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import CoulombFriction
from wbc.measurement import Log, save_log
from wbc.robot import Motion


def excited_log(effects=(), seed=0, duration=8.0):
    """Return what noisy sensors report while a multi-sine moves the fixed leg."""
    robot = load_robot("planar_leg_fixed").lossless().with_effects(*effects)
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 0.002)
    omega = 2.0 * np.pi * np.array([[0.37, 0.83, 1.31], [0.29, 0.71, 1.57]])
    size = np.array([[0.4, 0.25, 0.1], [0.4, 0.3, 0.1]])
    angle = omega[:, :, None] * time + np.array([[0.1, 1.0, 2.0], [0.5, 1.9, 0.3]])[:, :, None]
    q = (size[:, :, None] * np.sin(angle)).sum(1).T + np.array([0.4, -0.7])
    v = ((size * omega)[:, :, None] * np.cos(angle)).sum(1).T
    a = -((size * omega**2)[:, :, None] * np.sin(angle)).sum(1).T
    motion = Motion(q, v, a, time)
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    columns = {}
    for i, joint in enumerate(("hip", "knee")):
        columns[f"{joint}.position"] = q[:, i] + 2e-5 * rng.standard_normal(time.size)
        columns[f"{joint}.velocity"] = v[:, i] + 3e-3 * rng.standard_normal(time.size)
        columns[f"{joint}.rotor_torque"] = torque[:, i] + 2e-3 * rng.standard_normal(time.size)
    return Log(time, columns)


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory):
    """Two repeated runs of a leg whose hip rubs, as files."""
    folder = tmp_path_factory.mktemp("logs")
    paths = []
    for seed in (1, 2):
        path = folder / f"run{seed}.csv"
        save_log(excited_log([CoulombFriction("hip", 0.7)], seed), path)
        paths.append(str(path))
    return paths


LEG = ["--robot", "planar_leg_fixed", "--lossless"]


def test_diagnose_names_the_effect_and_saves_a_robot_that_explains_the_logs(
    rubbing, tmp_path, capsys
):
    fitted, result = tmp_path / "fitted.toml", tmp_path / "result.json"
    code = main(["diagnose", *rubbing, *LEG, "--save", str(fitted), "--json", str(result)])
    found = json.loads(result.read_text())
    assert code == 0
    assert found["verdict"] == "named"
    assert [(e["effect"], e["where"]) for e in found["effects"]] == [("coulomb_friction", ["hip"])]
    level = found["effects"][0]["parameters"]["level"]
    assert level["low"] < 0.7 < level["high"]
    assert found["error"]["after"] < 1.3 < 5.0 < found["error"]["before"]
    assert "coulomb_friction" in capsys.readouterr().out
    assert main(["compare", *rubbing, "--robot", str(fitted), "--json", str(result)]) == 0
    assert json.loads(result.read_text())["error"] < 1.3


def test_json_to_standard_output_is_nothing_but_json(rubbing, capsys):
    assert main(["compare", *rubbing, *LEG, "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["outputs"][0]["output"] == "hip"
    assert printed["outputs"][0]["ratio"] > 10.0 > 2.0 > printed["outputs"][1]["ratio"]


def test_check_reports_the_rate_and_finds_nothing_wrong(rubbing, capsys):
    assert main(["check", *rubbing, *LEG]) == 0
    assert "500.0 Hz" in capsys.readouterr().out


def test_metrics_print_the_papers_figures(tmp_path, capsys):
    result = tmp_path / "metrics.json"
    assert main(["metrics", "planar_leg", "--json", str(result)]) == 0
    metrics = json.loads(result.read_text())
    assert metrics["force up, lift [N]"] == pytest.approx(70.0, abs=1e-6)
    assert metrics["IMF up, dissipative"] == pytest.approx(0.863972, abs=1e-6)
    assert "GIT [kg]" in capsys.readouterr().out


@pytest.mark.parametrize("what", ["robots", "effects"])
def test_lists_name_what_there_is(what, capsys):
    assert main(["list", what]) == 0
    printed = capsys.readouterr().out
    assert ("planar_leg" if what == "robots" else "backlash") in printed


def test_help_fits_one_screen_and_shows_examples(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    printed = capsys.readouterr().out
    assert stop.value.code == 0
    assert len(printed.splitlines()) <= 30
    assert "wbc diagnose" in printed


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["compare", "nowhere.csv", *LEG], "nowhere.csv"),
        (["compare", "nowhere.csv", "--robot", "planar_lag"], "Did you mean 'planar_leg'?"),
        (["diagnose", "x.csv", *LEG, "--add", "colomb_friction"], "coulomb_friction"),
        (["metrics", "planar_leg", "--pose", "hip=high"], "JOINT=VALUE"),
        (["metrics", "planar_leg", "--contact", "hand"], "foot"),
    ],
)
def test_bad_input_exits_with_two_and_names_the_way_out(arguments, says, capsys):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert says in captured.err
    assert "Traceback" not in captured.err


def test_a_column_that_is_missing_is_named_with_those_there_are(tmp_path, capsys):
    log = excited_log()
    columns = {n: v for n, v in log.columns.items() if n != "knee.rotor_torque"}
    path = tmp_path / "short.csv"
    save_log(Log(log.time, columns), path)
    assert main(["compare", str(path), *LEG]) == 2
    message = capsys.readouterr().err
    assert "knee" in message
    assert "hip.rotor_torque" in message


def test_a_failed_run_leaves_no_file_behind(tmp_path):
    target = tmp_path / "fitted.toml"
    assert main(["diagnose", "nowhere.csv", *LEG, "--save", str(target)]) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["wbc", "dia"], "diagnose"),
        (["wbc", "compare", "--loss"], "--lossless"),
        (["wbc", "compare", "--robot", "planar_leg_f"], "planar_leg_fixed"),
        (["wbc", "diagnose", "--add", "coul"], "coulomb_friction"),
        (["wbc", "compare", "run_"], "run_1.csv"),
    ],
)
def test_bash_completes_commands_options_robots_effects_and_files(words, offered, tmp_path, capsys):
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    assert main(["completion", "bash"]) == 0
    (tmp_path / "wbc.sh").write_text(capsys.readouterr().out)
    (tmp_path / "run_1.csv").touch()
    typed = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}"
    script = f'source wbc.sh; {typed}; _shtab_wbc; echo "${{COMPREPLY[@]}}"'
    shown = subprocess.run([bash, "-c", script], cwd=tmp_path, capture_output=True, text=True)
    assert offered in shown.stdout.split()


@pytest.mark.parametrize(
    "command", [["list", "effects"], ["list", "robots"], ["metrics", "planar_leg"], ["--help"]]
)
def test_piped_output_fits_eighty_columns(command, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    with contextlib.suppress(SystemExit):
        main(command)
    shown = capsys.readouterr()
    assert shown.out
    assert max(map(len, shown.out.splitlines())) <= 80
    assert shown.err == ""


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_piped_tables_of_logs_fit_eighty_columns(command, rubbing, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([command, *rubbing, *LEG]) == 0
    shown = capsys.readouterr()
    assert max(map(len, shown.out.splitlines())) <= 80
    assert "\x1b" not in shown.out
    assert shown.err == ""
