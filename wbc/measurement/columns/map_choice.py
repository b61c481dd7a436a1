"""Which column map applies to a file, and what of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.column_map import ColumnMap
from wbc.measurement.columns.column_rule import ColumnRule, identity_rule
from wbc.measurement.formats.bag_table import BagTable
from wbc.measurement.formats.table import Table
from wbc.measurement.schema import TIME, is_column, likely_meant

_EFFORT = ".effort"


def native_map(table: Table) -> tuple[ColumnMap, tuple[str, ...]]:
    """Return the map of a file that has our names, and the columns that it passes over.

    Raises:
        LogError: no `time`, no column of the schema, or a name that looks misspelt.
    """
    names = table.names
    for name in names:
        meant = likely_meant(name)
        if meant is not None and meant not in names:
            raise LogError(
                f"{table.path}: column '{name}' looks like '{meant}' misspelt; rename it, or state "
                "what it is in a column map (--columns MAP.toml)."
            )
    if TIME not in names:
        raise LogError(
            f"{table.path}: " + unknown_name("column", TIME, names) + " Name the clock in a column "
            "map (--columns MAP.toml): [time] from = ..., or rate = ... for a file without one."
        )
    rules = [identity_rule(name) for name in names if name != TIME and is_column(name)]
    taken = {TIME, *(rule.target for rule in rules)}
    if isinstance(table, BagTable):
        efforts = [name for name in names if name.endswith(_EFFORT)]
        rules += [_effort_rule(name) for name in efforts]
        taken.update(efforts)
    if not rules:
        raise LogError(
            f"{table.path}: none of its columns has a name of a log (<joint>.position, ...); map "
            f"them with --columns MAP.toml. There are: {', '.join(names)}."
        )
    return ColumnMap(tuple(rules)), tuple(name for name in names if name not in taken)


def _effort_rule(name: str) -> ColumnRule:
    return replace(identity_rule(name), target=name.removesuffix(_EFFORT) + ".motor_torque")


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


def for_table(rules: ColumnMap, table: Table) -> ColumnMap:
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
