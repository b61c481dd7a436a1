"""Files that hold several joints in one array: NPZ with two axes, LeRobot datasets."""

from __future__ import annotations

import json
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


def test_init_reads_a_strangers_npz(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(MODEL)
    positions = np.stack([np.sin(TIME), 0.5 * np.cos(2.0 * TIME)], axis=1)
    np.savez(tmp_path / "run.npz", t=TIME, q=positions, tau=0.1 * positions)
    files = [str(tmp_path / "arm.xml"), str(tmp_path / "run.npz")]
    assert main(["init", *files, "--out", str(tmp_path / "out")]) == 0
    (log,) = load_logs([tmp_path / "run.npz"], tmp_path / "out" / "columns.toml")
    np.testing.assert_array_equal(log.stack("position", ["pan", "lift"]), positions)
    assert log.with_quantity("motor_torque") == ("pan", "lift")


def dataset(folder: Path, names: object) -> np.ndarray:
    """Two episodes of an arm with two joints, as version 2.1 and 3.0 of the format store them."""
    state = np.degrees(np.stack([np.sin(TIME), 0.5 * np.cos(2.0 * TIME)], axis=1))
    vector = pa.list_(pa.float32(), 2)
    for episode in range(2):
        path = folder / "data" / "chunk-000" / f"episode_{episode:06}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {
            "action": pa.array(list(1.01 * state), vector),
            "observation.state": pa.array(list(state), vector),
            "timestamp": pa.array(TIME, pa.float32()),
            "episode_index": np.full(TIME.size, episode),
        }
        pq.write_table(pa.table(columns), path)
    feature = {"dtype": "float32", "shape": [2], "names": names}
    info = {"fps": 30, "features": {"action": feature, "observation.state": feature}}
    (folder / "meta").mkdir(exist_ok=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return state


@pytest.mark.parametrize(
    "names", [["pan.pos", "lift.pos"], {"motors": ["pan", "lift"]}, ["pan", "lift"]]
)
def test_a_lerobot_dataset_is_its_episodes(names: object, tmp_path: Path) -> None:
    state = dataset(tmp_path / "set", names)
    table = tmp_path / "map.toml"
    joints = "\n".join(
        f'"{joint}.{what}" = {{unit = "deg"}}'
        for joint in ("pan", "lift")
        for what in ("position", "target_position")
    )
    table.write_text(f'[rows]\nsplit = "episode_index"\n[columns]\n{joints}\n')
    logs = load_logs([tmp_path / "set"], table)
    assert [log.source.part for log in logs] == ["0", "1"]
    np.testing.assert_allclose(
        logs[1].stack("position", ["pan", "lift"]), np.radians(state), atol=1e-6
    )
    np.testing.assert_allclose(
        logs[0].column("lift.target_position"), np.radians(1.01 * state[:, 1]), atol=1e-6
    )
    assert len(logs[0].source.sha256) == 64


def test_init_guesses_the_episodes_of_a_dataset(tmp_path: Path) -> None:
    dataset(tmp_path / "set", ["pan.pos", "lift.pos"])
    (tmp_path / "arm.xml").write_text(MODEL)
    files = [str(tmp_path / "arm.xml"), str(tmp_path / "set")]
    assert main(["init", *files, "--out", str(tmp_path / "out")]) == 0
    assert "episode_index" in (tmp_path / "out" / "columns.toml").read_text()


def test_a_damaged_dataset_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    with pytest.raises(LogError, match="no rosbag2 recording"):
        load_logs([folder])
    dataset(folder, None)
    with pytest.raises(LogError, match=r"'observation.state' with a name for every part"):
        load_logs([folder])
    (folder / "meta" / "info.json").write_text("{}")
    with pytest.raises(LogError, match=r"info.json': KeyError\('features'\)"):
        load_logs([folder])
