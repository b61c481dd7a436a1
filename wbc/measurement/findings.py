"""What checks find in logs, and what a column map says about it.

A map is a table: read, changed by another, and printed or written as lines of TOML.

A mend is such a table whose sources are channels of the log as it was read, for example
`{"columns": {"hip.velocity": {"sign": -1}}}`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import tomli_w

from wbc.errors import LogError
from wbc.files import SCHEMA, take_schema, write_text
from wbc.measurement.schema import LOG_UNITS, named_unit, split_column

Mend: TypeAlias = Mapping[str, Any]

RULE_KEYS = (
    "from",
    "unit",
    "scale",
    "sign",
    "offset",
    "weights",
    "side",
    "gear_ratio",
    "unwrap",
    "sign_bit",
    "lag",
    "empty",
    "missing",
    "optional",
)
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def read_table(path: str | Path | None) -> dict[str, Any]:
    """Return a column map as a table; an empty one for None.

    Raises:
        LogError: no such file, or no TOML.
    """
    if path is None:
        return {}
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as cause:
        raise LogError(f"cannot read the column map '{path}': {cause}.") from cause
    except tomllib.TOMLDecodeError as cause:
        raise LogError(
            f"cannot read the column map '{path}': {cause}. Each key stands once; lines such as "
            'time.unit = "ms" stand above the first [heading]. Option --fix of `wbc check` writes '
            "what it found together with the map in use."
        ) from cause
    if trouble := take_schema(table):
        raise LogError(f"cannot read the column map '{path}': {trouble}.")
    return table


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


def together(mends: Iterable[Mend]) -> dict[str, Any]:
    """Return one mend that holds all of several; what several logs say alike is done once."""
    result: dict[str, Any] = {}
    said: set[str] = set()
    for mend in mends:
        new: dict[str, Any] = {}
        for section, content in mend.items():
            if not isinstance(content, Mapping):
                new[section] = content
                continue
            once = {
                key: own for key, own in content.items() if f"{section} {key} {own}" not in said
            }
            said |= {f"{section} {key} {own}" for key, own in once.items()}
            new |= {section: once} if once else {}
        result = merged(result, new)
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
    if "unwrap" in new and ("unit" in old or "scale" in old):
        # The period is counted in the unit of the file, the mend in that of the log.
        worth = LOG_UNITS[named_unit(str(old["unit"]))][1] if "unit" in old else 1.0
        entry["unwrap"] = float(f"{new['unwrap'] / abs(worth * old.get('scale', 1.0)):.10g}")
    if "sign" in entry and entry["sign"] == 1:
        del entry["sign"]
    return entry


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


def in_degrees(names: Iterable[str], joints: Iterable[str], unit: str = "deg") -> Mend:
    """Return the mend of joints whose encoder columns, among `names`, are in degrees or turns."""
    known = set(names)
    return {
        "columns": {
            f"{joint}.{quantity}": {"unit": f"{unit}{rate}"}
            for joint in joints
            for quantity, rate in ENCODER_RATES.items()
            if f"{joint}.{quantity}" in known
        }
    }


ENCODER_RATES = {
    "position": "",
    "velocity": "/s",
    "acceleration": "/s^2",
    "target_position": "",
    "target_velocity": "/s",
}
"""Quantities that turn with the encoder of a joint -> what their unit has more than its."""


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


SEVERITIES = ("info", "warning", "error")


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

    def __str__(self) -> str:
        """Return one line for people."""
        place = f"{self.column}: " if self.column else ""
        return f"{self.severity}: {place}{self.text} {self.way_out}"


@dataclass(frozen=True)
class LogQuality:
    """Clock, resolution and findings of one log.

    Attributes:
        label: how messages call the log.
        rows: N.
        duration: [s].
        rate: 1 / median distance of the time stamps [Hz].
        jitter: standard deviation of the distances over their median.
        longest_gap: largest distance of two time stamps [s].
        resolution: channel -> quantisation step, in its unit; 0 where none shows.
        findings: in order of severity, gravest first.
    """

    label: str
    rows: int
    duration: float
    rate: float
    jitter: float
    longest_gap: float
    resolution: Mapping[str, float]
    findings: tuple[LogFinding, ...]

    @property
    def usable(self) -> bool:
        """Whether nothing was found that makes results wrong."""
        return all(finding.severity != "error" for finding in self.findings)

    def of_kind(self, kind: str) -> tuple[LogFinding, ...]:
        """Return the findings of one kind."""
        return tuple(finding for finding in self.findings if finding.kind == kind)

    def __str__(self) -> str:
        """Return a few lines for people."""
        head = (
            f"{self.label}: {self.rows} rows, {self.duration:.3f} s, {self.rate:.1f} Hz, jitter "
            f"{100.0 * self.jitter:.1f} %, longest gap {1e3 * self.longest_gap:.1f} ms"
        )
        return "\n".join([head, *(f"  {finding}" for finding in self.findings)])


def by_severity(findings: list[LogFinding]) -> tuple[LogFinding, ...]:
    """Return findings with the gravest first, otherwise in the order given."""
    return tuple(sorted(findings, key=lambda finding: -SEVERITIES.index(finding.severity)))


LIKELY = 0.9
"""Probability from which a mistake is worth a warning."""
CERTAIN = 0.99
"""Probability from which a mistake stops a diagnosis."""


def trusted(finding: LogFinding, trusts: bool) -> LogFinding:
    """Return a finding, as a warning where the user vouches for the columns."""
    if not trusts or finding.severity != "error":
        return finding
    return replace(finding, severity="warning")


def severity(probability: float) -> str:
    """Return how severe a mistake is that has a probability."""
    return "error" if probability >= CERTAIN else "warning"


class SuspiciousLogError(LogError):
    """Columns of logs hold something else than their names say.

    Attributes:
        findings: the suspicions, those that are certain first.
    """

    def __init__(self, message: str, findings: Sequence[LogFinding]) -> None:
        """Keep the findings beside the message."""
        super().__init__(message)
        self.findings = tuple(findings)


def listed(texts: Sequence[str]) -> str:
    """Return 'a, b and c', or 'a' where all texts are the same."""
    *first, last = texts
    if all(text == last for text in first):
        return last
    return f"{', '.join(first)} and {last}"
