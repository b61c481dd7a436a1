"""What a column map must say so that a log is right: printed, merged into a map, written.

A mend is a table with the layout of a column map whose sources are channels of the log as it was
read, for example `{"columns": {"hip.velocity": {"sign": -1}}}`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from wbc.files import write_text
from wbc.measurement.columns.map_table import Mend, merged

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


def together(mends: Iterable[Mend]) -> dict[str, Any]:
    """Return one mend that holds all of several."""
    total: dict[str, Any] = {}
    for mend in mends:
        total = merged(total, mend)
    return total


def write_map(path: str | Path, table: Mend, comments: Iterable[str] = ()) -> Path:
    """Write a column map with comments above it.

    Args:
        path: the TOML file.
        table: sections of the map.
        comments: lines that stand above it.
    """
    head = "".join(f"# {line}\n" for line in comments)
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    body = "".join(f"{line}\n" for line in lines(plain))
    for section, content in table.items():
        if isinstance(content, Mapping):
            entries = [f"{_key(key)} = {_value(value)}\n" for key, value in content.items()]
            body += f"\n[{_key(section)}]\n" + "".join(entries)
    return write_text(path, head + body)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return "{ " + inner + " }" if inner else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return str(tomli_w.dumps({"x": value})).split("=", 1)[1].strip()
