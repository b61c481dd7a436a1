"""Writing files whole or not at all, reading tables, and the version of their formats."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite, isnan
from pathlib import Path
from secrets import token_hex
from typing import Any, BinaryIO

from wbc.errors import WbcError

SCHEMA = 2
"""Version of the formats written: JSON of commands, saved robots, column maps. 0.1 wrote none."""


def atomic_write(path: str | Path, write: Callable[[BinaryIO], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then rename it to `path`.

    A reader sees the old file or the new one, never a half; a failure leaves the old one.

    Args:
        path: destination; missing folders are made.
        write: called with the open binary file.

    Returns:
        The destination as a Path.
    """
    destination = Path(path)
    destination.parent.mkdir(parents=True, exist_ok=True)
    temporary = destination.parent / f".{destination.name}.{token_hex(8)}"
    try:
        with temporary.open("xb") as file:
            write(file)
        os.replace(temporary, destination)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(destination)  # a full disk names no file
        raise
    return destination


def write_text(path: str | Path, text: str) -> Path:
    """Write `text` (UTF-8) to `path`, whole or not at all."""
    return atomic_write(path, lambda file: file.write(text.encode("utf-8")))


def as_json(value: Any, infinite: str | None = None) -> Any:
    """Return what JSON can hold of a value: of a dataclass its fields, of arrays and tuples lists.

    Args:
        value: of dataclasses, mappings, sequences, arrays, paths, texts and numbers.
        infinite: what stands for an infinite number; NaN is always None.
    """
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(name): as_json(entry, infinite) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [as_json(entry, infinite) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None if isnan(value) else infinite
    return str(value) if isinstance(value, Path) else value


def load_table(
    path: str | Path,
    what: str,
    error: type[WbcError],
    parse: Callable[[str], Any] = tomllib.loads,
    hint: str = "",
) -> dict[str, Any]:
    """Return the table that a file holds, without the version of its format.

    Args:
        path: the file.
        what: how messages call it.
        error: class of what is raised.
        parse: returns what the text of the file says.
        hint: what to do about a text that says nothing.

    Raises:
        WbcError: of that class; no such file, no table in it, or a newer version.
    """
    failed = f"cannot read {what} '{path}'"
    try:
        table = parse(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as cause:
        raise error(f"{failed}: {cause}.") from cause
    except ValueError as cause:
        raise error(f"{failed}: {cause}.{hint}") from cause
    if not isinstance(table, dict):
        raise error(f"{failed}: it holds no table.")
    version, own = table.pop("schema", 1), f"write schema = {SCHEMA}"
    if not isinstance(version, int) or version < 1:
        raise error(f"{failed}: schema = {version!r} is no version; remove the line, or {own}.")
    if version > SCHEMA:
        wrote = f"a newer wbc wrote it (schema = {version}, this one reads {SCHEMA})"
        raise error(f"{failed}: {wrote}: install the newer wbc, or {own} to read it all the same.")
    return table
