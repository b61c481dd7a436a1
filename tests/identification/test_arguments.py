"""Wrong arguments of compare and diagnose are told in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.errors import IdentificationError
from wbc.identification import compare, diagnose
from wbc.measurement import Log

TIME = np.arange(1000) * 0.005
LOG = Log(TIME, {"hip.position": np.sin(TIME), "knee.position": np.cos(TIME)})


@pytest.mark.parametrize("what", [compare, diagnose])
def test_names_single_logs_and_paths_are_told_in_words(what: Callable[..., object]) -> None:
    robot = load_robot("planar_leg_fixed")
    for arguments, says in (
        (("planar_leg_fixed", [LOG]), r"not 'planar_leg_fixed'; load it with load_robot"),
        ((robot, LOG), r"give one log as \[log\]"),
        ((robot, "run.csv"), r"not 'run.csv'; read files with load_logs"),
        ((robot, Path("run.csv")), r"not 'run.csv'; read files with load_logs"),
        ((robot, 3), r"logs are expected, not '3'"),
        ((robot, ["run.csv"]), r"not 'run.csv'; read files with load_logs"),
    ):
        with pytest.raises(IdentificationError, match=says):
            what(*arguments)


@pytest.mark.parametrize("what", [compare, diagnose])
def test_a_description_without_gears_is_told_in_words(
    what: Callable[..., object], tmp_path: Path
) -> None:
    model = Path(__file__).parents[2] / "robots" / "planar_leg" / "planar_leg.urdf"
    (tmp_path / "robot.toml").write_text(f'name = "bare"\nmodel = "{model}"\n')
    with pytest.raises(IdentificationError, match=r"'bare' has no gears(?s:.*)\[gears.JOINT\]"):
        what(load_robot(tmp_path / "robot.toml"), [LOG])
