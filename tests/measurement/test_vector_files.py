"""Files that hold several joints in one array: NPZ with two axes, lists in Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wbc.cli import main
from wbc.errors import LogError
from wbc.measurement import load_logs

TIME = np.arange(300) / 30.0
MODEL = """<mujoco><worldbody>
<body name="a"><joint name="pan" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/>
<body name="b" pos="0 0 .2"><joint name="lift" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("order", ["C", "F"])
def test_an_array_with_two_axes_is_several_columns(order: str, tmp_path: Path) -> None:
    positions = np.array(np.stack([np.sin(TIME), np.cos(TIME)], axis=1), order=order)
    np.savez(tmp_path / "run.npz", t=TIME, q=positions)
    table = tmp_path / "map.toml"
    table.write_text(
        'time.from = "t"\n[columns]\n"hip.position" = {from = "q_0"}\n'
        '"knee.position" = {from = "q_1"}\n'
    )
    (log,) = load_logs([tmp_path / "run.npz"], table)
    np.testing.assert_array_equal(log.stack("position", ["hip", "knee"]), positions)
    np.savez(tmp_path / "run.npz", t=TIME, q=np.zeros((300, 2, 2)))
    with pytest.raises(LogError, match=r"'q' has shape \(300, 2, 2\), expected \(rows,\) or"):
        load_logs([tmp_path / "run.npz"], table)


def test_the_files_of_a_lerobot_dataset_are_read_as_its_vectors(tmp_path: Path) -> None:
    """Two episodes in one file, whose clock starts again; no map is needed."""
    (tmp_path / "arm.xml").write_text(MODEL)
    state = np.stack([np.sin(TIME), 0.5 * np.cos(2.0 * TIME)], axis=1)
    vectors = {"observation.state": state, "action": 1.01 * state}
    columns = {
        name: pa.array(list(np.tile(values, (2, 1))), pa.list_(pa.float64(), 2))
        for name, values in vectors.items()
    }
    path = tmp_path / "episodes.parquet"
    pq.write_table(pa.table({**columns, "timestamp": np.tile(TIME, 2)}), path)
    assert main(["init", str(tmp_path / "arm.xml"), str(path), "--out", str(tmp_path / "out")]) == 0
    logs = load_logs([path], tmp_path / "out" / "columns.toml")
    assert len(logs) == 2
    joints = ["pan", "lift"]
    np.testing.assert_array_equal(logs[1].stack("position", joints), state)
    np.testing.assert_array_equal(logs[0].stack("target_position", joints), 1.01 * state)


def test_a_folder_without_a_recording_is_told(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no rosbag2 recording"):
        load_logs([tmp_path])
