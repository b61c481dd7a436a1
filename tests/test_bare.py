"""The library without its extras, and as a wheel in an empty environment."""

import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest

from wbc.errors import BROUGHT, EXTRAS

ROOT = Path(__file__).resolve().parents[1]
EXTRA_PACKAGES = sorted({*BROUGHT, *(one for packages in EXTRAS.values() for one in packages)})
_WITHOUT = f"""
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRA_PACKAGES!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""
_CONTROLLER = """
from wbc import load_robot
from wbc.control import Controller, PointContact, PointFootBalanceTask, PostureTask, Reference
from wbc.sim import Plant

robot = load_robot("planar_leg_strong")
tasks = [PointFootBalanceTask(contact="foot", frame="base", weight=100.0)]
tasks.append(PostureTask.of(robot, weight=1e-3))
controller = Controller(robot, tasks, contacts=[PointContact(name="foot")])
plant = Plant(robot)
state = plant.state(robot.pose())
for tick in range(5):
    command = controller.step(state, {"balance": Reference(0.0)})
    state = plant.step(state, command.rotor_torque, dt=1e-3).state
assert command.status.name == "SOLVED", command.status
"""
_LOGS = """
import wbc.identification, wbc.view
import numpy as np
from wbc.errors import MissingPackageError
from wbc.measurement import Log, load_log, save_log

log = Log(0.01 * np.arange(9.0), {"hip.position": np.sin(np.arange(9.0))})
save_log(log, "run.npz")
assert np.array_equal(load_log("run.npz").column("hip.position"), log.column("hip.position"))
with open("run.csv", "w") as file:
    file.write("time,hip.position\\n0,0\\n1,1\\n")

def refused(call):
    try:
        call()
    except MissingPackageError as error:
        return str(error)
    raise SystemExit(f"{call} was not refused")

def draw():
    import wbc.view.plots

def design():
    from wbc.design import Study, parse_sweep, run_study
    pose = (0.0, 0.0, 0.0, 0.0, 1.0)
    run_study(Study("planar_leg", (parse_sweep("reduction=6:160"),), "foot", pose), "x.parquet")

print(refused(lambda: load_log("run.csv")))
print(refused(lambda: save_log(log, "run.parquet")))
print(refused(lambda: wbc.view.write_playback))
print(refused(draw))
print(refused(design))
"""


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=folder, check=False
    )


def test_a_controller_in_its_loop_loads_no_extra(tmp_path: Path) -> None:
    """Where they are installed: so it runs where they are not."""
    shown = f"import wbc.identification\nprint(sorted(set({EXTRA_PACKAGES!r}) & set(sys.modules)))"
    done = run(f"import sys\n{_CONTROLLER}\n{shown}", tmp_path)
    assert done.stdout.strip() == "[]", done.stderr


def test_what_needs_an_extra_says_which(tmp_path: Path) -> None:
    done = run(_WITHOUT + _LOGS, tmp_path)
    assert done.returncode == 0, done.stderr
    pictures = "meshcat matplotlib plotly jinja2"
    needed = ("pyarrow", "pyarrow", pictures, pictures, "joblib pyarrow")
    for said, packages in zip(done.stdout.splitlines(), needed, strict=True):
        assert f"pip install {packages}" in said


def test_the_command_without_its_extra_says_which(tmp_path: Path) -> None:
    done = run(_WITHOUT + "from wbc.cli import main; sys.exit(main(['list', 'robots']))", tmp_path)
    assert done.returncode == 2
    assert "pip install rich" in done.stderr


def test_every_extra_that_a_message_names_can_be_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for extra, names in EXTRAS.items():
        stated = project["optional-dependencies"][extra]
        assert [re.split("[>=]", one)[0] for one in stated] == list(names)
    core = " ".join(project["dependencies"])
    assert not [package for package in EXTRA_PACKAGES if package in core]


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_import_of_something_else_stays_what_it_is(extra: str) -> None:
    from wbc.errors import needs

    with pytest.raises(ModuleNotFoundError, match="of_ours"), needs(extra, "this"):
        raise ModuleNotFoundError("no of_ours", name="wbc.of_ours")


_USES = """
import sys
from pathlib import Path
import wbc
from wbc.samples import sample_logs
from wbc.view import write_playback
assert Path(wbc.__file__).is_relative_to(sys.prefix), wbc.__file__
robot = wbc.load_robot("planar_leg_fixed")
assert str(robot.source.name) == "planar_leg_fixed"
write_playback("run.html", robot, sample_logs()[0])
"""


def test_the_wheel_runs_from_an_empty_environment(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="hatchling is not installed (pip install hatchling)")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("wbc-*.whl")
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env" / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
    subprocess.run([*install, "--no-index", "--no-deps", str(wheel)], check=True)
    # What the library needs is that of this environment; the library itself is the wheel's.
    (site,) = (tmp_path / "env" / "lib").glob("python*/site-packages")
    needed = f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n"
    (site / "needed.pth").write_text(needed)

    def run(*command: str) -> str:
        away = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
        done = subprocess.run(command, cwd=tmp_path, env=away, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(str(python), "-c", _USES)
    assert (tmp_path / "run.html").stat().st_size > 500_000
    assert "planar_leg" in run(str(python.with_name("wbc")), "list", "robots")
    version = wheel.name.split("-")[1]
    assert run(str(python.with_name("wbc")), "--version").split() == ["wbc", version]
