"""The commands: what they print, write, load and complete, and how they refuse bad input."""

import contextlib
import json
import subprocess
import sys
from math import inf

import pytest

from tests.cli.conftest import LEG
from wbc.cli import main, models
from wbc.effects import EFFECTS
from wbc.errors import WbcError
from wbc.measurement import save_log
from wbc.samples import sample_paths

COMMANDS = ["compare", "diagnose", "check", "play", "metrics", "design", "experiment", "list"]
PIPED = ["list effects", "list robots", "metrics planar_leg", "--help"]
PIPED += ["compare LOGS", "diagnose LOGS", "check LOGS", "identify LOGS"]


def test_diagnose_names_the_effect_and_saves_a_robot_that_explains_the_logs(
    rubbing, tmp_path, told
):
    fitted, result = tmp_path / "fitted.toml", tmp_path / "result.json"
    said = told("diagnose", *rubbing, *LEG, "--save", fitted, "--json", result)
    assert "coulomb_friction" in said
    found = json.loads(result.read_text())
    assert found["verdict"] == "named"
    assert [(e["effect"], e["where"]) for e in found["effects"]] == [("coulomb_friction", ["hip"])]
    level = found["effects"][0]["parameters"]["level"]
    assert level["low"] < 0.7 < level["high"]
    assert found["error"]["after"] < 1.3 < 5.0 < found["error"]["before"]
    told("compare", *rubbing, "--robot", fitted, "--json", result)
    assert json.loads(result.read_text())["error"] < 1.3


@pytest.mark.parametrize(
    ("given", "least", "most"), [((), 230, 240), (("--budget", "inf"), inf, inf)]
)
def test_a_diagnosis_ends_in_minutes_unless_it_may_take_longer(given, least, most, monkeypatch):
    """The search on the logs of a recorded arm of six joints did not end by itself in 300 s."""
    budgets = []

    def stop(robot, logs, candidates, progress, budget):
        budgets.append(budget)
        raise WbcError("stopped here.")

    monkeypatch.setattr(models, "diagnose", stop)
    main(["diagnose", *map(str, sample_paths()), "--robot", "planar_leg_fixed", *given])
    assert least <= budgets[0] <= most


def test_a_robot_that_is_saved_without_an_effect_is_said_to_be_as_given(
    excited_log, tmp_path, told
):
    sound = save_log(excited_log(duration=2.0), tmp_path / "sound.csv")
    said = told("diagnose", sound, *LEG, "--save", fitted := tmp_path / "fitted.toml")
    assert f"wrote {fitted}: the robot as given, no effect was added" in said


def test_json_to_standard_output_is_nothing_but_json(rubbing, told):
    printed = json.loads(told("compare", *rubbing, *LEG, "--json", "-"))
    assert printed["outputs"][0]["output"] == "hip"
    assert printed["outputs"][0]["ratio"] > 10.0 > 2.0 > printed["outputs"][1]["ratio"]


def test_metrics_print_the_papers_figures(tmp_path, told):
    result = tmp_path / "metrics.json"
    printed = told("metrics", "planar_leg", "--json", result)
    metrics = json.loads(result.read_text())
    assert metrics["force up, lift [N]"] == pytest.approx(70.0, abs=1e-6)
    assert metrics["IMF up, dissipative"] == pytest.approx(0.863972, abs=1e-6)
    assert metrics["holding torque, lossless [N m]"]["knee"] == pytest.approx(1.8639)
    assert "GIT [kg]" in printed
    assert "1.8639 knee" in printed


def test_joints_that_a_log_does_not_hold_are_told(rubbing, tmp_path, told):
    page = tmp_path / "run.html"
    said = told("play", rubbing[0], "--robot", "planar_leg", "--html", page)
    assert "no position of base_x, base_z, base_pitch" in said
    assert page.stat().st_size > 100_000


@pytest.mark.parametrize("command", [*PIPED, *(f"{name} --help" for name in COMMANDS)])
def test_piped_output_fits_eighty_columns(command, rubbing, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    with contextlib.suppress(SystemExit):
        assert main(command.replace("LOGS", " ".join([*rubbing, *LEG])).split()) == 0
    shown = capsys.readouterr()
    # Commands to copy are whole lines, however long.
    whole = "    wbc " if "LOGS" in command else "\n"
    lines = [line for line in shown.out.splitlines() if not line.startswith(whole)]
    assert 0 < max(map(len, lines)) <= 80
    assert "\x1b" not in shown.out
    assert shown.err == ""
    if command == "list effects":  # `directional_viscous_friction` was cut
        assert set(EFFECTS) <= set(shown.out.split())


def test_python_m_wbc_writes_its_files_though_the_reader_leaves(tmp_path):
    command = [sys.executable, "-m", "wbc", "metrics", "planar_leg", "--json", tmp_path / "m.json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as run:
        run.stdout.close()
    assert run.returncode == 0 < (tmp_path / "m.json").stat().st_size


def test_metrics_name_the_gears_that_hold_and_what_robot_toml_lacks(told, monkeypatch):
    """Two tables of zeros were printed, no torque above its limit was marked, and the known torque
    constants of Solo12 were called unknown."""
    pytest.importorskip("example_robot_data")
    monkeypatch.setenv("COLUMNS", "120")
    shown = told("metrics", "solo12")
    assert "0.0000" not in shown
    assert "0.3128 FL_KFE (above its limit 0.3)" in shown
    assert "all others" in shown
    assert "robot.toml has no resistance of any motor" in shown
    assert "torque_constant" not in shown


_RUN = """
import sys
from wbc.cli import main as run
for command in COMMANDS:
    try:
        run(command)
    except SystemExit:
        pass
slow = [name for name in ("wbc.control", "wbc.sim.plant") if name in sys.modules]
print("loaded:", *slow)
"""


def told(code: str) -> list[str]:
    """Return the words of the last line that a program of its own prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def loaded(*commands: list[str]) -> list[str]:
    """Return which of the slow rooms some commands, one after another, have loaded."""
    return told(_RUN.replace("COMMANDS", repr(commands)))[1:]


def test_the_list_of_commands_loads_none_of_them() -> None:
    """`wbc --help` took 2.6 s: it imported what every command needs.

    The command asks for one thread before numpy is loaded: a diagnosis of a recorded arm took 120
    in place of 69 s of processor time on two.
    """
    found = told("import sys, wbc.cli.options as o; o.build_parser(); print(*sys.modules)")
    heavy = {"rich", "pyarrow", "scipy.spatial", "wbc.identification", "wbc.measurement"}
    heavy |= {"wbc.design", "wbc.view", "numpy", "numba", "llvmlite"}
    assert heavy & set(found) == set()


def test_an_answer_does_not_wait_for_the_compiler() -> None:
    """The open-loop error, which needs the plant, follows the answer; a check needs none."""
    paths, robot = list(map(str, sample_paths())), [*LEG, "--quiet"]
    helps = [["--help"], ["diagnose", "--help"], ["design", "--help"]]
    answer = ["diagnose", "--add", "coulomb_friction", *paths, *robot]
    assert loaded(*helps, ["list", "effects"], ["check", paths[0], *robot], answer) == []


def test_a_simulation_is_loaded_when_it_is_used_by_a_name_that_no_module_hides() -> None:
    """`from wbc.sim import simulate` gave the module once another part had loaded it."""
    code = (
        "import pkgutil, sys, wbc.sim\n"
        "modules = {m.name for m in pkgutil.iter_modules(wbc.sim.__path__)}\n"
        "wbc.sim.Plant; loaded = 'wbc.sim.plant' in sys.modules\n"
        "print(loaded, sorted(modules & set(wbc.sim.__all__)))"
    )
    assert told(code) == ["True", "[]"]
