"""The model to use predicts best; what its causes are called is another question."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tests.outside import DATA, ROOT, outside
from wbc import load_robot
from wbc.effects import (
    CoulombFriction,
    LinkInertia,
    LinkInertias,
    LoadFriction,
    RotorInertia,
    StribeckFriction,
    TorqueConstant,
    TorqueOffset,
    ViscousFriction,
)
from wbc.identification import diagnose, rank_robots
from wbc.identification.classic import identify
from wbc.measurement import Log, load_logs

ROBOT = str(DATA / "tmotor_ak80" / "robot.toml")


def bench(columns: str, *names: str) -> tuple[Log, ...]:
    folder = outside("tmotor_ak80")
    return load_logs([folder / f"{name}.parquet" for name in names], folder / columns)


def test_what_is_not_believed_stays_in_the_model() -> None:
    """Gain and friction leave 1 N m less in every fold; their names had been taken out."""
    diagnosis = diagnose(load_robot(ROBOT), bench("current.toml", "final_8"))
    (output,) = diagnosis.outputs
    assert output.after < 0.4 * output.before  # the classic fit leaves 0.8 of it
    assert {"torque_constant", "rotor_coulomb_friction"} <= {e.name for e in diagnosis.effects}


def test_a_commanded_torque_is_corrected_on_a_log_that_was_not_seen() -> None:
    robot = load_robot(ROBOT)
    first, second = bench("command.toml", "sysid_1", "sysid_2")
    found = diagnose(robot, [first]).robot
    plain = robot.with_effects(TorqueOffset("motor", 0.0))
    ranked = rank_robots({"given": plain, "found": found}, [second])
    errors = {row.name: row.error for row in ranked}
    assert errors["found"] < 0.2 * errors["given"]


def test_no_joint_of_a_leg_is_left_with_more_than_by_the_classic_fit(tmp_path: Path) -> None:
    """Causes of two models, fitted together from the numbers of both, left 1.5 times as much."""
    text = (ROOT / "robots" / "go2" / "robot.toml").read_text()
    head, *gears = re.split(r"(?=^\[gears\.)", text, flags=re.MULTILINE)
    others = [re.findall(r"\w+", gear)[1] for gear in gears if "[gears.FL" not in gear]
    leg = tmp_path / "leg.toml"
    own = "".join(gear for gear in gears if "[gears.FL" in gear)
    leg.write_text(f"{head}lock = {others}\n\n{own}")
    robot = load_robot(str(leg)).lossless()
    columns = ROOT / "robots" / "go2" / "columns.toml"
    logs = load_logs([outside("go2_position_control/go2_air.parquet")], columns)
    kinds = (CoulombFriction, ViscousFriction, StribeckFriction, LoadFriction, TorqueOffset)
    links = (RotorInertia, LinkInertia, LinkInertias, TorqueConstant)
    left = [output.after for output in diagnose(robot, logs, (*kinds, *links)).outputs]
    assert np.all(left < 1.02 * identify(robot, logs).left)
