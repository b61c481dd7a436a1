"""The model to use predicts best; what its causes are called is another question."""

from __future__ import annotations

import numpy as np

from tests.outside import DATA, outside
from wbc import load_robot
from wbc.effects import CoulombFriction, TorqueOffset, ViscousFriction
from wbc.identification import diagnose, rank_robots
from wbc.measurement import Log, load_logs
from wbc.sim.excitation import record_with

ROBOT = str(DATA / "tmotor_ak80" / "robot.toml")
LEG = load_robot("planar_leg_fixed").lossless()


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


def test_where_the_names_explain_all_nothing_is_added() -> None:
    hidden = [ViscousFriction("hip", 0.3), CoulombFriction("knee", 0.5), TorqueOffset("hip", 0.4)]
    diagnosis = diagnose(LEG, record_with(LEG, hidden, duration=4.0))
    assert {f.effect.key for f in diagnosis.findings} == {e.key for e in hidden}
    for output in diagnosis.outputs:
        assert output.after < 1.2 * output.floor


def test_what_stands_for_its_torque_alone_is_said_apart() -> None:
    diagnosis = diagnose(
        LEG, record_with(LEG, [CoulombFriction("hip", 0.5)], duration=3.0), budget=0
    )
    doubted = [f for f in diagnosis.findings if f.probability < 0.5]
    assert doubted
    assert "may stand in for something else" in str(diagnosis)
    entries = diagnosis.to_json()["effects"]
    assert np.allclose(
        [e["probability"] for e in entries], [f.probability for f in diagnosis.findings]
    )
