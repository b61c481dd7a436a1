"""Which column map applies to a file, and what of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.column_map import ColumnMap
from wbc.measurement.columns.column_rule import ColumnRule, identity_rule
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.columns.mend import say_so
from wbc.measurement.columns.units import LOG_UNITS
from wbc.measurement.formats.table import Table
from wbc.measurement.schema import TIME, column_units, is_column, known_as, likely_meant

_EFFORT = ".effort"
_CLOCK: Mend = {"time": {"from": "CLOCK"}}
_RATE: Mend = {"time": {"rate": 100}}


def patched(rules: ColumnMap, table: Table) -> tuple[ColumnMap, tuple[str, ...], tuple[str, ...]]:
    """Return the map that reads a file: the columns with our names, changed as a map says.

    Args:
        rules: a map; one without entries changes nothing.
        table: the file.

    Returns:
        The map with an entry for every channel, the columns that it passes over, and notes on what
        was taken for granted.

    Raises:
        LogError: no clock, no channel, a name that looks misspelt, or a column that the file lacks.
    """
    own, notes = _own_rules(table)
    stated = [_resolved(rule, own) for rule in rules.rules]
    used = {source for rule in stated for source in rule.sources} | set(rules.rows.keys)
    _require_spelling(table, rules, used)
    taken = {name for rule in stated for name in known_as(rule.target)} | set(rules.left_out)
    passed = [
        rule
        for target, rule in own.items()
        if target not in taken and not used & set(rule.sources) and target != rules.time.source
    ]
    complete = replace(rules, rules=(*passed, *stated))
    _require_clock(complete, table)
    complete = _for_table(complete, table)
    read = {s for rule in complete.rules for s in rule.sources} | {rules.time.source, *used}
    ignored = tuple(n for n in table.names if n not in read and n not in rules.left_out)
    kept = {rule.target for rule in complete.rules}
    return complete, ignored, tuple(note for target, note in notes.items() if target in kept)


def restricted(rules: ColumnMap, only: Sequence[str] | None, label: str) -> ColumnMap:
    """Return the map without the channels that are not wanted.

    Raises:
        LogError: a channel that the map does not give.
    """
    if only is None:
        return rules
    for name in only:
        if name != TIME and name not in rules.targets:
            raise LogError(f"{label}: " + unknown_name("column", name, rules.targets))
    return replace(rules, rules=tuple(rule for rule in rules.rules if rule.target in only))


def _own_rules(table: Table) -> tuple[dict[str, ColumnRule], dict[str, str]]:
    """Return the entries of the columns that need no map, by channel, and notes on some."""
    rules: dict[str, ColumnRule] = {}
    notes: dict[str, str] = {}
    for name in table.names:
        if name != TIME and is_column(name):
            rules[name] = _in_unit(identity_rule(name), table.units.get(name, ""))
    for name in table.names:
        target = name.removesuffix(_EFFORT) + ".motor_torque"
        if name.endswith(_EFFORT) and len(name) > len(_EFFORT) and target not in rules:
            rules[target] = replace(identity_rule(name), target=target)
            notes[target] = _taken(name, target)
    return rules, notes


def _taken(name: str, target: str) -> str:
    """Return the note on an effort, with what to say if it is something else."""
    joint = name.removesuffix(_EFFORT)
    torque: Mend = {"columns": {f"{joint}.rotor_torque": {"from": name}}}
    current: Mend = {"columns": {f"{joint}.current": {"from": name}}}
    return (
        f"{name} is taken for {target}. If it is the rotor's torque, {say_so(torque)}\n"
        f"If it is a current [A], {say_so(current)}"
    )


def _in_unit(rule: ColumnRule, unit: str) -> ColumnRule:
    """Return a rule with the factor of the unit that the file itself states, if we know it."""
    kind, factor = LOG_UNITS.get(unit, ("", 1.0))
    return replace(rule, factors=(factor,)) if kind in (column_units(rule.target) or ()) else rule


def _resolved(rule: ColumnRule, own: dict[str, ColumnRule]) -> ColumnRule:
    """Return a rule that names no source with the one that its channel has in this file."""
    if not rule.implied:
        return rule
    held = next((own[name] for name in known_as(rule.target) if name in own), None)
    return rule if held is None else replace(rule, sources=held.sources)


def _require_spelling(table: Table, rules: ColumnMap, used: set[str]) -> None:
    """Raise where a column that nothing uses looks like one of ours misspelt."""
    clock = rules.time.rate > 0.0 or rules.time.source != TIME
    given = {*table.names, *rules.targets, *rules.left_out, *((TIME,) if clock else ())}
    for name in table.names:
        meant = likely_meant(name)
        if meant is None or meant in given or name in used | set(rules.left_out):
            continue
        found: Mend = {"time": {"from": name}}
        if meant != TIME:
            found = {"columns": {meant: {"from": name}}}
        raise LogError(
            f"{table.path}: column '{name}' looks like '{meant}' misspelt; rename it, or "
            + say_so(found)
        )


def _require_clock(rules: ColumnMap, table: Table) -> None:
    if rules.time.source == TIME and TIME not in table.names:
        raise LogError(
            f"{table.path}: "
            + unknown_name("column", TIME, table.names)
            + f" Put the name of the clock's column in place of CLOCK, and {say_so(_CLOCK)}\n"
            + f"If the file has no clock, put its rate [Hz] in place of 100, and {say_so(_RATE)}"
        )
    if not rules.rules:
        raise LogError(
            f"{table.path}: none of its columns has a name of a log (<joint>.position, ...). "
            f"There are: {', '.join(table.names)}. Let `wbc init MODEL {table.path}` write a first "
            "column map for the URDF, MJCF or robot MODEL."
        )


def _for_table(rules: ColumnMap, table: Table) -> ColumnMap:
    """Return the map without the optional channels that a file lacks.

    Raises:
        LogError: the file lacks a column that the map needs, or the map leaves no channel.
    """
    names = set(table.names)
    label = rules.path or "column map"
    needed = [(f"columns.{r.target}", s) for r in rules.rules if not r.optional for s in r.sources]
    needed += [("rows", key) for key in rules.rows.keys]
    if rules.time.source:
        needed.append(("time", rules.time.source))
    for key, name in needed:
        if name not in names:
            raise LogError(
                f"{label}: {key}: " + unknown_name(f"column of '{table.path}'", name, table.names)
            )
    kept = tuple(rule for rule in rules.rules if names.issuperset(rule.sources))
    if not kept:
        raise LogError(f"{label}: '{table.path}' has none of the columns that the map names.")
    return replace(rules, rules=kept)
