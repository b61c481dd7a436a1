"""The wheel, built and installed into an empty environment, is the whole library."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
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
