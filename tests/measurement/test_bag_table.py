import importlib.util
from pathlib import Path

import numpy as np
import pytest

from wbc.errors import LogError
from wbc.measurement import formats as bag_table, load_log

needs_rosbags = pytest.mark.skipif(
    importlib.util.find_spec("rosbags") is None,
    reason="the optional extra is not installed: pip install rosbags",
)


def test_without_the_extra_the_message_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_table, "find_spec", lambda name: None)
    path = tmp_path / "run.mcap"
    path.write_bytes(b"something")
    with pytest.raises(LogError, match="pip install rosbags"):
        load_log(path)


def record(
    folder: Path, plugin: str, topics: tuple[str, ...] = ("/joint_states",), odd: bool = False
) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    state = types.types["sensor_msgs/msg/JointState"]
    header, stamp = types.types["std_msgs/msg/Header"], types.types["builtin_interfaces/msg/Time"]
    with Writer(folder, version=9, storage_plugin=StoragePlugin[plugin]) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, state.__msgtype__, typestore=types)
            for k in range(200):
                now = 1_700_000_000 * 10**9 + k * 2_000_000
                names = ["hip", "knee"] if k % 2 else ["knee", "hip"]
                values = {"hip": 0.01 * k, "knee": -0.02 * k}
                if odd and k == 150:
                    names = ["hip"]
                message = state(
                    header=header(stamp=stamp(sec=now // 10**9, nanosec=now % 10**9), frame_id=""),
                    name=names,
                    position=np.array([values[n] for n in names]),
                    velocity=np.array([{"hip": 5.0, "knee": -10.0}[n] for n in names]),
                    effort=np.array([{"hip": 1.0, "knee": 2.0}[n] for n in names]),
                )
                writer.write(connection, now, types.serialize_cdr(message, state.__msgtype__))
    return folder


@needs_rosbags
@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_joint_states_become_a_log(plugin: str, tmp_path: Path) -> None:
    folder = record(tmp_path / "run", plugin)
    log = load_log(folder)
    assert set(log.joints) == {"hip", "knee"}
    np.testing.assert_allclose(log.time, np.arange(200) * 0.002, atol=1e-12)
    np.testing.assert_allclose(log.column("hip.position"), 0.01 * np.arange(200))
    np.testing.assert_allclose(log.column("knee.velocity"), -10.0)
    np.testing.assert_allclose(log.column("knee.motor_torque"), 2.0)
    if plugin == "MCAP":
        assert len(load_log(next(folder.glob("*.mcap")))) == 200


@needs_rosbags
def test_a_map_gives_effort_another_meaning_and_chooses_the_topic(tmp_path: Path) -> None:
    folder = record(tmp_path / "run", "MCAP", ("/left", "/right"))
    with pytest.raises(LogError, match=r"several JointState topics \(/left, /right\)") as caught:
        load_log(folder)
    assert 'rows.topic = "/left"' in str(caught.value)
    text = '[rows]\ntopic = "/right"\n[columns]\n'
    text += '"hip.current" = { from = "hip.effort", unit = "mA" }\n'
    (tmp_path / "map.toml").write_text(text)
    np.testing.assert_allclose(load_log(folder, tmp_path / "map.toml").column("hip.current"), 1e-3)
    (tmp_path / "map.toml").write_text(text.replace("/right", "/rigth"))
    with pytest.raises(LogError, match="Did you mean '/right'"):
        load_log(folder, tmp_path / "map.toml")


@needs_rosbags
def test_bags_that_cannot_be_used_say_why(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"at 0\.300000 s lacks knee"):
        load_log(record(tmp_path / "odd", "MCAP", odd=True))
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no bag at all")
    with pytest.raises(LogError, match="cannot read the bag"):
        load_log(broken)
    whole = next(record(tmp_path / "cut", "MCAP").glob("*.mcap"))
    for share in (0.2, 0.6, 0.95):
        broken.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
        with pytest.raises(LogError, match=r"cannot read the bag.*broken\.mcap"):
            load_log(broken)
