"""A column map as a table: read, its lines gathered into their sections, patched by another."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from wbc.errors import LogError
from wbc.measurement.columns.column_rule import RULE_KEYS
from wbc.measurement.columns.row_choice import ROW_KEYS
from wbc.measurement.columns.time_rule import TIME_KEYS
from wbc.measurement.schema import JOINT_QUANTITIES, split_column

Mend: TypeAlias = Mapping[str, Any]

_HEADING = re.compile(r"(?m)^(?=[ \t]*\[)")
_KEYS = {"time": TIME_KEYS, "rows": ROW_KEYS}


def read_table(path: str | Path | None) -> dict[str, Any]:
    """Return a column map as a table, its lines in their sections; an empty one for None.

    Raises:
        LogError: no such file, or no TOML.
    """
    if path is None:
        return {}
    try:
        text = Path(path).read_text(encoding="utf-8")
        try:
            table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as cause:
            table = _in_blocks(text, cause)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as cause:
        raise LogError(f"cannot read the column map '{path}': {cause}.") from cause
    return gathered(table)


def gathered(table: Mend) -> dict[str, Any]:
    """Return a map with the lines of all sections in their sections.

    A printed line names its section, `time.unit = "ms"`. Pasted below the heading `[columns]`, TOML
    takes it for `columns.time.unit`. It means the same there: it mends what the map says without
    it.
    """
    pasted: dict[str, Any] = {}
    own = {
        key: _without_pasted(content, pasted) if isinstance(content, Mapping) else content
        for key, content in table.items()
    }
    return merged(own, pasted) if pasted else own


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
            result["columns"] = _columns(column_entries(first), column_entries(second))
        elif isinstance(content, Mapping):
            result[section] = {**result.get(section, {}), **content}
        else:
            result[section] = content
    return result


def column_entries(table: Mapping[str, Any], label: str = "column map") -> dict[str, Any]:
    """Return the entries of [columns] by the full name of their column.

    Raises:
        LogError: an entry that is neither a name nor a table.
    """
    return dict(_entries(table.get("columns", {}), "", label))


def _entries(table: Mapping[str, Any], prefix: str, label: str) -> Iterator[tuple[str, Any]]:
    """Yield (column name, entry); unquoted TOML keys with dots arrive as nested tables."""
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, str) or value is False or _is_rule(name, value):
            yield name, value
        elif isinstance(value, Mapping) and value:
            yield from _entries(value, f"{name}.", label)
        else:
            raise LogError(
                f"{label}: columns.{name}: give the foreign name, a table such as "
                '{ unit = "deg" }, or false to leave the column out.'
            )


def _is_rule(name: str, value: Any) -> bool:
    """Whether a table is an entry, and not what unquoted names with dots nest."""
    if not isinstance(value, Mapping):
        return False
    known = bool(value) and set(value) <= set(RULE_KEYS)
    return known or split_column(name) is not None or "from" in value


def _without_pasted(table: Mapping[str, Any], pasted: dict[str, Any]) -> dict[str, Any]:
    """Return a section without the lines of other sections, which go to `pasted`."""
    own: dict[str, Any] = {}
    for key, value in table.items():
        if _is_section(key, value):
            held = pasted.get(key, {})
            inner = _without_pasted(value, pasted) if isinstance(value, Mapping) else value
            pasted[key] = _joined(held, inner) if isinstance(inner, Mapping) else inner
        elif isinstance(value, Mapping):
            own[key] = _without_pasted(value, pasted)
        else:
            own[key] = value
    return own


def _is_section(key: str, value: Any) -> bool:
    """Whether a key below a heading is the name of a section, and not part of a joint's name."""
    if key == "trusted":
        return value is True
    if not isinstance(value, Mapping) or not value:
        return False
    if key == "columns":
        return not set(value) & set(JOINT_QUANTITIES)
    return key in _KEYS and set(value) <= set(_KEYS[key])


def _in_blocks(text: str, refused: tomllib.TOMLDecodeError) -> dict[str, Any]:
    """Return a map whose headings come twice, or that has lines of a section above its heading.

    TOML refuses both. Lines above the first heading mend what stands below the headings.

    Raises:
        TOMLDecodeError: `refused`, where a part is no TOML, or one key is given twice.
    """
    head, *sections = (tomllib.loads(part) for part in _HEADING.split(text))
    table: dict[str, Any] = {}
    for section in sections:
        table = _joined(table, section, refused)
    return merged(gathered(table), gathered(head))


def _joined(
    first: Mapping[str, Any], second: Mapping[str, Any], refused: Exception | None = None
) -> dict[str, Any]:
    """Return both tables as one; of a key in both the second counts, or `refused` is raised."""
    joined = dict(first)
    for key, value in second.items():
        held = joined.get(key)
        if isinstance(held, Mapping) and isinstance(value, Mapping):
            joined[key] = _joined(held, value, refused)
        elif key in joined and refused is not None:
            raise refused
        else:
            joined[key] = value
    return joined


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
