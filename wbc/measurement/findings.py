"""What checks find in logs, and what a column map says about it.

A map is a table: read, changed by another, and printed or written as lines of TOML.

A mend is such a table whose sources are channels of the log as it was read, for example
`{"columns": {"hip.velocity": {"sign": -1}}}`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from wbc.files import SCHEMA, write_text
from wbc.tables import joined

Mend: TypeAlias = Mapping[str, Any]

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def say_so(mend: Mend, what: str = "say so") -> str:
    """Return how to do something in a column map, with the lines of the map that do it.

    The lines stand below the sentence, indented, so that they can be copied into a file; what
    follows them belongs on a new line.
    """
    return f"{what} in a column map (--columns MAP.toml):\n    " + "\n    ".join(lines(mend))


def lines(mend: Mend) -> list[str]:
    """Return a mend as lines of TOML that stand for themselves, one per entry."""
    found = []
    for section, content in mend.items():
        if not isinstance(content, Mapping):
            found.append(f"{_key(section)} = {_value(content)}")
            continue
        for key, value in content.items():
            found.append(f"{_key(section)}.{_key(key)} = {_value(value)}")
    return found


def write_map(path: str | Path, table: Mend, comments: Iterable[str] = ()) -> Path:
    """Write a column map, a line for each entry and no headings: a printed line fits anywhere.

    Args:
        path: the TOML file.
        table: sections of the map.
        comments: lines that stand above it.
    """
    head = [f"# {line}" for text in comments for line in text.splitlines()]
    body = lines({"schema": SCHEMA, **table})
    return write_text(path, "\n".join([*head, *body]) + "\n")


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return "{ " + inner + " }" if inner else "{}"
    return json.dumps(value, ensure_ascii=False)  # TOML writes texts, numbers and lists alike


@dataclass(frozen=True)
class LogFinding:
    """What is odd about a channel, and what to do about it.

    Attributes:
        severity: `error` makes results wrong, `warning` makes them worse, `info` is good to know.
        kind: short name for machines, such as `clock_lag`.
        column: the channel, `time`, or empty for the whole log.
        text: what was seen, with numbers.
        way_out: what to do.
        mend: what a column map says so that the log is right; empty where no map can.
        probability: that it is so.
        guess: what a map would say of the likeliest of several causes that the logs cannot tell
            apart. Nothing writes it: people choose.
        alone: whether only some of the logs that were given together have it.
    """

    severity: str
    kind: str
    column: str
    text: str
    way_out: str
    mend: Mend = field(default_factory=dict)
    probability: float = 1.0
    guess: Mend = field(default_factory=dict)
    alone: bool = False

    @property
    def likeliest(self) -> Mend:
        """What a map says if the likeliest cause is the true one."""
        return self.mend or self.guess

    @property
    def said(self) -> str:
        """Where it is, what was seen, and what to do."""
        return f"{f'{self.column}: ' if self.column else ''}{self.text} {self.way_out}"

    def __str__(self) -> str:
        """Return one line for people."""
        return f"{self.severity}: {self.said}"


LIKELY = 0.9
"""Probability from which a mistake is worth a warning."""
CERTAIN = 0.99
"""Probability from which a mistake stops a diagnosis."""


def severity(probability: float) -> str:
    """Return how severe a mistake is that has a probability."""
    return "error" if probability >= CERTAIN else "warning"


def listed(texts: Sequence[str]) -> str:
    """Return 'a, b and c', or 'a' where all texts are the same."""
    return joined(texts if len(set(texts)) > 1 else texts[:1])
