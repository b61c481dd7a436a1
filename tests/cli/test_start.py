"""What a command loads: the compiled loops of plant and controller take a minute the first time."""

from __future__ import annotations

import subprocess
import sys

import pytest

from wbc.samples import sample_paths

_RUN = """
import sys
from wbc.cli import main as run
try:
    run(sys.argv[1:])
except SystemExit:
    pass
slow = [name for name in ("wbc.control", "wbc.sim.plant") if name in sys.modules]
print("loaded:", *slow)
"""


def loaded(*arguments: str, refused: str = "") -> list[str]:
    """Return which of the slow rooms one command has loaded, and check that it was refused."""
    run = [sys.executable, "-c", _RUN, *arguments]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    assert refused in done.stderr
    return done.stdout.splitlines()[-1].split()[1:]


@pytest.mark.parametrize("command", ["", "diagnose", "design"])
def test_help_loads_neither_plant_nor_controller(command: str) -> None:
    assert loaded(*filter(None, [command, "--help"])) == []


def test_the_list_of_commands_loads_none_of_them() -> None:
    """`wbc --help` took 2.6 s: it imported what every command needs."""
    code = "import sys, wbc.cli.options as o; o.build_parser(); print('loaded:', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"rich", "pyarrow", "wbc.identification", "wbc.measurement", "wbc.design", "wbc.view"}
    assert heavy & set(done.stdout.split()) == set()


def test_checking_a_log_loads_neither() -> None:
    path = str(sample_paths()[0])
    assert loaded("check", path, "--robot", "planar_leg_fixed") == []
    assert loaded("list", "effects") == []


def test_an_answer_does_not_wait_for_the_compiler() -> None:
    """The open-loop error, which needs the plant, follows the answer."""
    paths = [str(path) for path in sample_paths()]
    robot = ["--robot", "planar_leg_fixed", "--lossless"]
    assert loaded("diagnose", "--add", "coulomb_friction", *paths, *robot, "--quiet") == []


def test_a_simulation_is_loaded_when_it_is_used() -> None:
    code = "import sys, wbc.sim; wbc.sim.Plant; print('loaded:', 'wbc.sim.plant' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "True"


def test_no_name_of_the_plant_is_hidden_by_a_module_of_the_same_name() -> None:
    """`from wbc.sim import simulate` gave the module once another part had loaded it."""
    code = (
        "import pkgutil, wbc.sim, types\n"
        "modules = {m.name for m in pkgutil.iter_modules(wbc.sim.__path__)}\n"
        "print(sorted(modules & set(wbc.sim.__all__)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]"]
