"""Logs of the fixed leg as files, made once."""

from collections.abc import Callable

import pytest

from tests.moved import swing
from wbc import load_robot
from wbc.cli import main
from wbc.effects import CoulombFriction
from wbc.measurement import Log, save_log
from wbc.robot import Effect

LEG = ["--robot", "planar_leg_fixed", "--lossless"]
Told = Callable[..., str]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run a command that must end with a code (0); return what it printed, on one line."""

    def run(*words: object, code: int = 0) -> str:
        found = main([str(word) for word in words])
        said = " ".join("".join(capsys.readouterr()).split())
        assert found == code, said
        return said

    return run


@pytest.fixture(scope="session")
def excited_log() -> Callable[..., Log]:
    """Return what noisy sensors report while two sines per joint move the fixed leg."""

    def make(effects: tuple[Effect, ...] = (), seed: int = 0, duration: float = 4.0) -> Log:
        robot = load_robot("planar_leg_fixed").lossless().with_effects(*effects)
        return swing(robot, seed, seconds=duration)

    return make


@pytest.fixture(scope="session")
def rubbing(excited_log: Callable[..., Log], tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two repeated runs of a leg whose hip rubs, as files."""
    folder = tmp_path_factory.mktemp("logs")
    paths = []
    for seed in (1, 2):
        path = folder / f"run{seed}.csv"
        save_log(excited_log((CoulombFriction("hip", 0.7),), seed), path)
        paths.append(str(path))
    return paths
