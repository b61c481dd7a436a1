"""JointState messages of a rosbag2 folder or an MCAP file, through the optional `rosbags`."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.mend import say_so
from wbc.measurement.formats.table import Chunk, Table
from wbc.measurement.schema import TIME

_TYPE = "sensor_msgs/msg/JointState"
_FIELDS = ("position", "velocity", "effort")
_MESSAGES = 8192


class BagTable(Table):
    """One JointState topic as columns `time`, `<joint>.position`, `.velocity` and `.effort`.

    `time` is the header's stamp in seconds since the first message (the recorder's stamp where
    headers carry none).
    """

    def __init__(self, path: Path, topic: str = "") -> None:
        """Read the first message of the topic.

        Args:
            path: rosbag2 folder, or its MCAP or SQLite file.
            topic: which JointState topic, empty for the only one.

        Raises:
            LogError: `rosbags` is not installed, the bag is unreadable, or there is no such topic.
        """
        if find_spec("rosbags") is None:
            raise LogError(
                f"reading the bag '{path}' needs the package rosbags; install it with: "
                "pip install 'wbc[rosbags]'"
            )
        self.path = path
        self._topic, self._count = self._find_topic(topic)
        first = next(self._messages(), None)
        if first is None:
            raise LogError(f"{path}: topic '{self._topic}' holds no message.")
        self._joints = tuple(str(name) for name in first[1].name)
        self._fields = tuple(f for f in _FIELDS if len(getattr(first[1], f)) == len(self._joints))
        self._start = first[0]

    @property
    def names(self) -> tuple[str, ...]:
        """`time` and the fields of every joint of the first message."""
        return (TIME, *(f"{joint}.{field}" for joint in self._joints for field in self._fields))

    @property
    def rows(self) -> int:
        """Number of messages of the topic."""
        return self._count

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`).

        Raises:
            LogError: a bag has no text columns, or a message lacks joints of the first.
        """
        if keys:
            raise LogError(f"{self.path}: a bag has no column '{keys[0]}' to choose rows by.")
        rows: list[list[float]] = []
        for stamp, message in self._messages():
            rows.append(self._row(stamp, message))
            if len(rows) == _MESSAGES:
                yield self._columns(rows)
                rows = []
        if rows:
            yield self._columns(rows)

    def _columns(self, rows: list[list[float]]) -> dict[str, NDArray[np.float64]]:
        return dict(zip(self.names, np.asarray(rows).T.copy(), strict=True))

    def _row(self, stamp: int, message: Any) -> list[float]:
        place = {str(name): k for k, name in enumerate(message.name)}
        missing = [joint for joint in self._joints if joint not in place]
        seconds = (stamp - self._start) * 1e-9
        if missing or any(len(getattr(message, f)) != len(place) for f in self._fields):
            raise LogError(
                f"{self.path}: the message of '{self._topic}' at {seconds:.6f} s lacks "
                f"{', '.join(missing) or 'values'} of the first message; several publishers share "
                "the topic? Record them on topics of their own."
            )
        order = [place[joint] for joint in self._joints]
        return [seconds, *(float(getattr(message, f)[k]) for k in order for f in self._fields)]

    def _find_topic(self, topic: str) -> tuple[str, int]:
        with self._open() as bag:
            counts: dict[str, int] = {}
            for connection in bag.connections:
                if connection.msgtype == _TYPE:
                    counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
        if not counts:
            raise LogError(f"{self.path}: no topic of type {_TYPE}.")
        if not topic and len(counts) > 1:
            raise LogError(
                f"{self.path} has several JointState topics ({', '.join(counts)}); "
                + say_so({"rows": {"topic": next(iter(counts))}}, "choose one, such as the first,")
            )
        chosen = topic or next(iter(counts))
        if chosen not in counts:
            raise LogError(f"{self.path}: " + unknown_name("JointState topic", chosen, counts))
        return chosen, counts[chosen]

    def _messages(self) -> Iterator[tuple[int, Any]]:
        """Yield (stamp [ns], message) in the order of recording."""
        with self._open() as bag:
            chosen = [c for c in bag.connections if c.topic == self._topic]
            for connection, received, raw in bag.messages(connections=chosen):
                message = bag.deserialize(raw, connection.msgtype)
                yield _stamp(message) or received, message

    @contextmanager
    def _open(self) -> Iterator[Any]:
        """Open the bag; damage that shows then or later becomes a LogError."""
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag2 import ReaderError
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore

        # The parser of the bag asserts and unpacks where a file is cut off.
        damage = (OSError, AnyReaderError, ReaderError, SerdeError, struct.error, AssertionError)
        try:
            types = get_typestore(Stores.ROS2_HUMBLE)
            with AnyReader([self.path], default_typestore=types) as bag:
                yield bag
        except damage as cause:
            raise LogError(
                f"cannot read the bag '{self.path}': {str(cause) or type(cause).__name__}. Was the "
                "recording cut off? The tools of its format can often repair the index."
            ) from cause


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
