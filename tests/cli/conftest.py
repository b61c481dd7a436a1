"""Logs of the fixed leg as files, made once."""

from collections.abc import Callable

import pytest

from tests.moved import swing
from wbc import load_robot
from wbc.effects import CoulombFriction
from wbc.measurement import Log, save_log
from wbc.robot import Effect

LEG = ["--robot", "planar_leg_fixed", "--lossless"]
Excited = Callable[..., Log]


@pytest.fixture(scope="session")
def excited_log() -> Excited:
    """Return what noisy sensors report while two sines per joint move the fixed leg."""

    def make(effects: tuple[Effect, ...] = (), seed: int = 0, duration: float = 4.0) -> Log:
        robot = load_robot("planar_leg_fixed").lossless().with_effects(*effects)
        return swing(robot, seed, seconds=duration)

    return make


@pytest.fixture(scope="session")
def rubbing(excited_log: Excited, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two repeated runs of a leg whose hip rubs, as files."""
    folder, rubs = tmp_path_factory.mktemp("logs"), (CoulombFriction("hip", 0.7),)
    return [str(save_log(excited_log(rubs, k), folder / f"run{k}.csv")) for k in (1, 2)]
