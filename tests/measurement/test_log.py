import numpy as np
import pytest

from wbc.errors import LogError
from wbc.measurement import Log, LogSource


def test_contacts_and_base_are_no_joints() -> None:
    names = ("base.position.x", "base.orientation.w", "hip.position", "left.foot.force.z")
    log = Log(np.arange(3.0), {name: np.arange(3.0) for name in names})
    assert log.joints == ("hip",)
    assert log.contacts == ("left.foot",)
    assert log.with_quantity("force.z") == ("left.foot",)


def test_rows_are_cut_by_index_and_by_time(swing: Log) -> None:
    assert len(swing[100:200]) == 100
    part = swing.between(1.0, 2.0)
    assert part.time[0] == pytest.approx(1.0)
    assert part.time[-1] < 2.0
    np.testing.assert_array_equal(
        part.column("hip.position"), swing.column("hip.position")[500:1000]
    )
    with pytest.raises(LogError, match=r"between 9 s and 10 s; the log runs from 0 s to 3\.998 s"):
        swing.between(9.0, 10.0)


ROWS = [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("time", "columns", "words"),
    [
        ([0.0, 1.0, 1.0], {}, ["time repeats at row 2", "repeated"]),
        ([0.0, 2.0, 1.0], {}, ["time goes back at row 2"]),
        ([0.0], {}, ["1 rows"]),
        ([0.0, 1.0, np.nan], {}, ["'time' holds nan at row 2"]),
        (ROWS, {"hip.position": [0.0, np.inf, 1.0]}, ["'hip.position' holds inf at row 1"]),
        (ROWS, {"hip.position": [0.0, 1.0]}, ["'hip.position' has 2 rows, time has 3"]),
        (ROWS, {"hip.position": ["a", "b", "c"]}, ["instead of numbers"]),
        (ROWS, {"hip.position": np.zeros((3, 2))}, ["shape (3, 2)"]),
        (ROWS, {"hip.velocty": np.zeros(3)}, ["Did you mean 'hip.velocity'"]),
        (ROWS, {"torque": np.zeros(3)}, ["'torque' is not a column", "rotor_torque"]),
    ],
)
def test_bad_channels_are_refused_by_name_and_row(
    time: list[float], columns: dict[str, object], words: list[str]
) -> None:
    with pytest.raises(LogError) as caught:
        Log(np.asarray(time), columns, LogSource(path="run.csv"))  # type: ignore[arg-type]
    for word in ["run.csv", *words]:
        assert word in str(caught.value)


def test_nothing_about_a_log_can_be_changed(swing: Log) -> None:
    with pytest.raises(ValueError, match="read-only"):
        swing.time[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        swing.column("hip.position")[0] = 1.0
    with pytest.raises(TypeError):
        swing.columns["hip.position"] = swing.time  # type: ignore[index]
    # A read-only view of somebody else's array is copied, too; and large is not infinite.
    mine = np.array([0.0, 1.0, 1e308])
    view = mine[:]
    view.setflags(write=False)
    log = Log(np.arange(3.0), {"hip.position": mine, "hip.velocity": view})
    mine[:] = -7.0
    np.testing.assert_array_equal(log.column("hip.position"), [0.0, 1.0, 1e308])
    np.testing.assert_array_equal(log.column("hip.velocity"), [0.0, 1.0, 1e308])


def test_a_table_in_memory_becomes_a_log() -> None:
    log = Log.from_frame({"time": [0.0, 0.1], "hip.position": [1, 2], "comment": ["a", "b"]})
    np.testing.assert_array_equal(log.column("hip.position"), [1.0, 2.0])
    assert log.source.ignored == ("comment",)
    with pytest.raises(LogError, match="Unknown column 'time'"):
        Log.from_frame({"t": [0.0, 0.1]})
    with pytest.raises(LogError, match="or a dictionary of columns by name, not list; files are"):
        Log.from_frame([1, 2])


def test_a_log_shows_itself_on_a_screen() -> None:
    """A humanoid's log: not one number of it, and not all of its names."""
    joints = [f"joint_{k}" for k in range(30)]
    names = [f"{joint}.{q}" for joint in joints for q in ("position", "velocity", "rotor_torque")]
    shown = repr(Log(np.arange(100) * 0.01, {name: np.zeros(100) for name in names}))
    assert "100 rows in 0.99 s" in shown
    assert "joint_0.velocity, joint_0.rotor_torque" in shown
    assert "and 82 more" in shown
    assert len(shown) < 600
