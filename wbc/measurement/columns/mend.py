"""What a column map must say so that a log is right: printed, merged into a map, written.

A mend is a table with the layout of a column map whose sources are channels of the log as it was
read, for example `{"columns": {"hip.velocity": {"sign": -1}}}`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import tomli_w

from wbc.errors import LogError
from wbc.files import write_text
from wbc.measurement.columns.column_map import column_entries

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


def merged(first: Mend, second: Mend) -> dict[str, Any]:
    """Return the map that reads a file as `first` says, and then mends the log as `second` says.

    Args:
        first: a parsed column map, or an empty table.
        second: a mend of the log that `first` gives.
    """
    result = {
        section: dict(content) if isinstance(content, Mapping) else content
        for section, content in first.items()
    }
    for section, content in second.items():
        if section == "columns":
            result["columns"] = _columns(column_entries(first), content)
        elif isinstance(content, Mapping):
            result[section] = {**result.get(section, {}), **content}
        else:
            result[section] = content
    return result


def together(mends: Iterable[Mend]) -> dict[str, Any]:
    """Return one mend that holds all of several."""
    total: dict[str, Any] = {}
    for mend in mends:
        total = merged(total, mend)
    return total


def read_table(path: str | Path | None) -> dict[str, Any]:
    """Return a column map as a table; an empty one for None.

    Raises:
        LogError: no such file, or no TOML.
    """
    if path is None:
        return {}
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as cause:
        raise LogError(f"cannot read the column map '{path}': {cause}.") from cause


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


def _columns(before: Mapping[str, Any], mend: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of [columns] that first read and then mend."""
    used = {_source(name, entry) for name, entry in mend.items() if entry is not False}
    entries = {name: entry for name, entry in before.items() if name not in used}
    for name, entry in mend.items():
        if entry is False:
            entries[name] = False
            continue
        source = _source(name, entry)
        own = {"from": entry} if isinstance(entry, str) else dict(entry)
        read = before.get(source, {})
        old = {"from": read} if isinstance(read, str) else dict(read or {})
        entry = _combined(old, own)
        if entry.get("from", name) != name or source != name:
            entry = {"from": old.get("from", source), **{k: entry[k] for k in entry if k != "from"}}
        entries[name] = entry
    return entries


def _source(name: str, entry: Any) -> str:
    if isinstance(entry, str):
        return entry
    return str(entry.get("from", name))


def _combined(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    entry: dict[str, Any] = {**old, **{key: value for key, value in new.items() if key != "from"}}
    for key in ("sign", "scale"):
        if key in old and key in new:
            entry[key] = old[key] * new[key]
    if "sign" in entry and entry["sign"] == 1:
        del entry["sign"]
    return entry


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
