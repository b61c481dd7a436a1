from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wbc.errors import LogError
from wbc.measurement import Log, load_log, load_logs, save_log
from wbc.measurement.columns.decimator import Decimator

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
SUFFIXES = [".csv", ".parquet", ".npz"]


@st.composite
def logs(draw: st.DrawFn) -> Log:
    rows = draw(st.integers(2, 30))
    steps = draw(arrays(np.float64, rows, elements=st.floats(1e-4, 0.01)))
    names = draw(
        st.lists(
            st.from_regex(r"[a-z_][a-z0-9_. ,]{0,8}[a-z]", fullmatch=True), min_size=1, unique=True
        )
    )
    columns = {
        f"{name}.current": draw(arrays(np.float64, rows, elements=FINITE)) for name in names[:4]
    }
    return Log(np.cumsum(steps), columns)


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=40, deadline=None)
@given(log=logs())
def test_what_is_written_is_read_back_bit_by_bit(suffix: str, log: Log) -> None:
    with tempfile.TemporaryDirectory() as folder:
        read = load_log(save_log(log, Path(folder) / f"log{suffix}"))
    np.testing.assert_array_equal(read.time, log.time)
    assert read.names == log.names
    for name in log.names:
        np.testing.assert_array_equal(read.column(name), log.column(name))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_only_the_columns_asked_for_are_read(suffix: str, swing: Log, tmp_path: Path) -> None:
    path = save_log(swing, tmp_path / f"log{suffix}")
    read = load_log(path, only=["knee.velocity"])
    assert read.names == ("knee.velocity",)
    assert len(read.source.sha256) == 64
    with pytest.raises(LogError, match=r"Did you mean 'knee\.velocity'"):
        load_log(path, only=["knee.velocty"])


def test_a_failed_write_leaves_the_old_file(swing: Log, tmp_path: Path) -> None:
    path = save_log(swing, tmp_path / "log.csv")
    before = path.read_bytes()
    with pytest.raises(LogError, match=r"\.csv, \.parquet, \.npz"):
        save_log(swing, tmp_path / "log.mat")
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_long_log_is_decimated_without_aliasing(suffix: str, tmp_path: Path) -> None:
    time = np.arange(150_001) * 1e-3
    slow, fast = np.sin(2 * np.pi * 3.0 * time), np.sin(2 * np.pi * 97.0 * time)
    columns = {"hip.position": 2.0 + slow, "knee.position": fast, "hip.current": 3.0 * time}
    path = save_log(Log(time, columns), tmp_path / f"long{suffix}")
    read = load_log(path, max_rows=20_000)
    assert read.source.decimation == 8
    assert len(read) == 18_751
    inner = slice(10, -10)
    expected = 2.0 + np.sin(2 * np.pi * 3.0 * read.time)
    np.testing.assert_allclose(read.column("hip.position")[inner], expected[inner], atol=2e-3)
    # 97 Hz lies above the new Nyquist frequency of 62.5 Hz: plain picking would fold it to 28 Hz.
    assert np.abs(read.column("knee.position")[inner]).max() < 0.01
    np.testing.assert_allclose(read.column("hip.current"), 3.0 * read.time, atol=1e-9)


def test_decimation_does_not_depend_on_the_size_of_the_pieces() -> None:
    rows = np.random.default_rng(0).normal(size=(5000, 3)).cumsum(axis=0)

    def reduced(sizes: list[int]) -> np.ndarray:
        decimator, parts, start = Decimator(7), [], 0
        for size in sizes:
            parts.append(decimator.push(rows[start : start + size]))
            start += size
        parts.append(decimator.finish())
        return np.concatenate([part for part in parts if part.size])

    whole = reduced([5000])
    assert whole.shape == (-(-5000 // 7), 3)
    np.testing.assert_allclose(reduced([3, 40, 1, 956, 4000]), whole, atol=1e-9)
    np.testing.assert_allclose(reduced([50] * 100), whole, atol=1e-9)


GOOD = "time,hip.position\n0.0,1.0\n0.1,2.0\n0.2,3.0\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"", ["is empty"]),
        ("a.csv", b"time,hip.position\n", ["is empty", "no rows"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1\n", ["Expected 2 columns, got 1"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1,abc\n", ["invalid value 'abc'"]),
        ("a.csv", b"time;hip.position\n0;1,25\n", ["has decimal commas ('1,25')", "points"]),
        ("a.csv", b"time;hip.position\n0;-1,5e-3\n", ["has decimal commas ('-1,5e-3')"]),
        ("a.csv", b"time;hip.position\n0;1,2,3\n", ["invalid value '1,2,3'"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1,\n", ["'hip.position' holds nan at row 1"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1,inf\n", ["'hip.position' holds inf at row 1"]),
        ("a.csv", b"time,hip.position\n0.0,1\n0.1,1\n0.05,2\n", ["goes back at row 2"]),
        ("a.csv", b"time,hip.position\n0.0,1\n0.1,1\n0.1,2\n", ["repeats at row 2", "repeated"]),
        (
            "a.csv",
            b"t,hip.position\n0.0,1.0\n",
            ["'time'", "are: t, hip.position", "time.from"],
        ),
        ("a.csv", b"time,hip.positon\n0.0,1.0\n", ["'hip.positon' looks like 'hip.position'"]),
        ("a.csv", b"time,q1,q2\n0.0,1.0,2.0\n", ["wbc init", "time, q1, q2"]),
        (
            "a.csv",
            b"time,a.current,a.current\n0,1,2\n",
            ["more than one column called 'a.current'"],
        ),
        ("a.csv", b"\xff\x00\x01", ["cannot read", "as CSV"]),
        ("a.parquet", b"PAR1 and then nothing", ["cannot read", "Parquet", "damaged"]),
        ("a.npz", b"PK and then nothing", ["cannot read", "NPZ"]),
        ("a.xlsx", b"anything", ["'.xlsx' is not read", ".parquet"]),
    ],
)
def test_bad_files_say_what_is_wrong(
    name: str, content: bytes, words: list[str], tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        load_log(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


def test_a_missing_file_and_a_plain_folder_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no log at"):
        load_log(tmp_path / "none.csv")
    with pytest.raises(LogError, match="no rosbag2 recording"):
        load_log(tmp_path)


def test_a_parquet_cut_off_in_the_middle_is_an_error(swing: Log, tmp_path: Path) -> None:
    path = save_log(swing, tmp_path / "log.parquet")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(LogError, match="damaged"):
        load_log(path)
    damaged = bytearray(whole)
    damaged[200:2000] = bytes(1800)
    path.write_bytes(bytes(damaged))
    with pytest.raises(LogError, match=r"log\.parquet"):
        load_log(path)


def test_ragged_text_and_pickled_arrays_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, **{"time": np.arange(3.0), "hip.position": np.arange(4.0)})
    with pytest.raises(LogError, match=r"differ in length: time 3, hip\.position 4"):
        load_log(path)
    np.savez(path, **{"time": np.arange(3.0), "hip.position": np.array([{}, {}, {}])})
    with pytest.raises(LogError, match="Python objects"):
        load_log(path)
    np.savez(path, **{"time": np.arange(3.0), "hip.position": np.array(["a", "b", "c"])})
    with pytest.raises(LogError, match="instead of numbers"):
        load_log(path)
    np.savez(path, **{"time": np.arange(3.0), "hip.position": np.zeros((3, 2))})
    with pytest.raises(LogError, match="shape"):
        load_log(path)
    table = pa.table({"time": [0.0, 1.0], "hip.position": ["a", "b"]})
    pq.write_table(table, tmp_path / "log.parquet")
    with pytest.raises(LogError, match=r"'hip\.position' holds string instead of numbers"):
        load_log(tmp_path / "log.parquet")


def test_other_columns_are_passed_over_and_remembered(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,hip.position,mood\n0.0,1.0,good\n0.1,2.0,bad\n")
    log = load_log(path)
    assert log.names == ("hip.position",)
    assert log.source.ignored == ("mood",)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_the_delimiter_of_a_csv_is_seen_and_a_byte_order_mark_passed_over(
    mark: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(GOOD.replace(",", mark), encoding="utf-8-sig")
    np.testing.assert_array_equal(load_log(path).column("hip.position"), [1.0, 2.0, 3.0])


def test_a_hash_picks_a_log_only_where_a_map_splits_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(GOOD)
    with pytest.raises(LogError, match=r"nothing splits the file. Leave .#part. out"):
        load_logs([f"{path}#part"])
    odd = tmp_path / "log#1.csv"
    odd.write_text(GOOD)
    assert len(load_log(odd)) == 3
