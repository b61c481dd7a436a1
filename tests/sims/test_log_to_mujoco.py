"""From a log to MuJoCo: the leg found there needs the torque of the machine."""

from pathlib import Path

import pytest

from sims import log_to_mujoco


def test_mujoco_needs_the_torque_of_the_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = log_to_mujoco.main(duration=1.0)
    assert found["verdict"] == "named"
    assert found["errors"]["MuJoCo with losses"].max() < 0.01
    assert found["errors"]["MuJoCo without"].min() > 0.1
    assert [path.name for path in log_to_mujoco.report(found)] == ["log_to_mujoco.png"]
