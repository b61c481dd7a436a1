"""Columns of a file that nobody read, beside the channels that are missing."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.measurement.columns.map_table import Mend
from wbc.measurement.columns.mend import say_so
from wbc.measurement.guessing.names import guess_name, joints_of
from wbc.measurement.schema import split_column


def unread_map(ignored: Sequence[str], missing: Sequence[str]) -> Mend:
    """Return the map that reads missing channels from columns whose names look like them.

    Args:
        ignored: columns of the file that were not read.
        missing: channels; several quantities of one joint are ways to say the same.

    Returns:
        A map with at most one column for every joint; an empty one where no name looks like it.
    """
    wanted = [parts for parts in map(split_column, missing) if parts is not None]
    quantities = {quantity for _, quantity in wanted}
    fitting = [guess for guess in map(guess_name, ignored) if guess.quantity in quantities]
    fitting.sort(key=lambda guess: guess.rotor)  # of two columns, that of the joint itself
    owners = list(dict.fromkeys(guess.owner for guess in fitting))
    joints = list(dict.fromkeys(joint for joint, _ in wanted))
    named, by_name = joints_of(owners, joints)
    if len(owners) != len(joints):
        named = {owner: joint for owner, joint in named.items() if owner in by_name}
    columns: dict[str, dict[str, str]] = {}
    for guess in fitting:
        joint = named.get(guess.owner)
        if joint is None or (joint, guess.quantity) not in wanted or joint in _owners(columns):
            continue
        unit = {"unit": guess.unit} if guess.unit else {}
        columns[f"{joint}.{guess.quantity}"] = {"from": guess.name, **unit}
    return {"columns": columns} if columns else {}


def unread_columns(ignored: Sequence[str], missing: Sequence[str]) -> str:
    """Return what to do if a column that was not read is a channel that is missing.

    Args:
        ignored: columns of the file that were not read.
        missing: as for `unread_map`; one stands for all where no name looks like any.

    Returns:
        A sentence with the lines of a map, empty where every column was read.
    """
    if not ignored or not missing:
        return ""
    mend = unread_map(ignored, missing)
    if mend:
        names = [entry["from"] for entry in mend["columns"].values()]
        missed = _are(list(mend["columns"]))
        return f"{_unread(names)}, and {missed} missing. If they are the same, {say_so(mend)}"
    blank: Mend = {"columns": {missing[0]: {"from": "COLUMN"}}}
    return (
        f"{_unread(ignored)}, for want of a known name. If {missing[0]} is there, put the name of "
        f"its column in place of COLUMN, and {say_so(blank)}"
    )


def _owners(columns: Sequence[str] | dict[str, dict[str, str]]) -> set[str]:
    return {parts[0] for parts in map(split_column, columns) if parts is not None}


def _unread(names: Sequence[str]) -> str:
    quoted = ", ".join(f"'{name}'" for name in names)
    return f"Column {quoted} was not read" if len(names) == 1 else f"Columns {quoted} were not read"


def _are(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'}"
