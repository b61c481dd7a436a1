"""How answers are shown: text, notebook, numbers, torques over time, where a result came from."""

from __future__ import annotations

import math
import platform
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from wbc.arrays import FloatArray
from wbc.errors import needs
from wbc.identification.model.residual import raw_residual
from wbc.identification.records.record import Record
from wbc.measurement import LogSource
from wbc.robot import Robot
from wbc.tables import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Of a screen: what `repr` shows at most.
_LINES = 24
_LONG = 1e6  # width from which on an interval is written with exponents
_LOST = 1e3  # [rad, m] error from which a simulation has left the log
_NONE = 1e-6  # [rad, m] finer than an encoder of 22 bits: nothing moved
_PACKAGES = ("wbc", "pin", "numpy", "scipy", "proxsuite")


@dataclass(frozen=True, eq=False)
class Series:
    """One log's torques over time, in the band of the residual.

    Attributes:
        name: of the log.
        time: (rows,) [s].
        measured: (rows, m) reported torque at the motor output [N m].
        residual: (rows, m + b) measured minus modelled [N m, N], weighted: near a reversal it
            counts for nothing.
        modelled: (rows, m) torque that the model needs for the motion [N m], not weighted.
    """

    name: str
    time: FloatArray
    measured: FloatArray
    residual: FloatArray
    modelled: FloatArray


def series_of(robot: Robot, records: Sequence[Record]) -> tuple[Series, ...]:
    """Return the torques that `robot` needs on logs beside those that were reported.

    Args:
        robot: with its effects.
        records: of logs, one or more.
    """
    gears, series = robot.transmission, []
    for record in records:
        left = raw_residual(robot, record)
        measured = record.condense_driven(record.torque) * abs(gears.gear_ratio)
        modelled = measured - record.condense_driven(left[:, : gears.size])
        series.append(Series(record.name, record.time, measured, record.condense(left), modelled))
    return tuple(series)


class Shown(ABC):
    """An answer as `print`, a notebook and a figure show it; what a subclass says fills it."""

    robot: Robot
    outputs: tuple[Any, ...]
    warnings: tuple[str, ...]

    @property
    @abstractmethod
    def sentence(self) -> str:
        """The answer, as a person would say it."""

    @property
    def to_do(self) -> str:
        """What to do now; empty where nothing follows."""
        return ""

    @abstractmethod
    def tables(self) -> tuple[TextTable, ...]:
        """Return what stands below the sentence."""

    @abstractmethod
    def models(self) -> list[tuple[str, Sequence[Series]]]:
        """Return label and torques of each model of the figure."""

    def __str__(self) -> str:
        """Return the sentence, what was found and left, what to do now, and warnings."""
        to_do = [f"do this now: {self.to_do}"] if self.to_do else []
        tables = [str(table) for table in self.tables() if table]
        return "\n".join([self.sentence, *tables, *to_do, *self.warnings])

    def __repr__(self) -> str:
        """Return what `print` shows, cut to one screen."""
        lines = str(self).splitlines()
        if len(lines) > _LINES:
            left = len(lines) - _LINES + 1
            lines[_LINES - 1 :] = [f"... {left} more lines: print(...) shows all"]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the answer as a notebook shows it."""
        to_do = f"Do this now: {escape(self.to_do)}"
        told = f"<p style='white-space: pre-wrap'>{to_do}</p>" if self.to_do else ""
        tables = "".join(table.html() for table in self.tables() if table)
        return f"<p><b>{escape(self.sentence)}</b></p>{told}{tables}"

    def plot(self, log: int = 0) -> Figure:
        """Return measured and modelled torques of one log over time, with the residuals.

        Args:
            log: number of the log.

        Raises:
            MissingPackageError: matplotlib is not installed.
        """
        with needs("view", "plot()"):
            from wbc.identification.answer.figure import torque_figure
        units = {o.output: o.unit for o in self.outputs[: self.robot.transmission.size]}
        return torque_figure(units, self.models(), log)


def plain(value: float, digits: int = 3) -> str:
    """Return a number with `digits` significant digits, without an exponent where it is short."""
    if not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < 6:
        return f"{value:.{max(0, digits - 1 - size)}f}".replace("-", "−")
    return f"{value:.{digits - 1}e}".replace("-", "−")


def efforts(units: Iterable[str]) -> str:
    """Return the word for what outputs with these units report: torque, force, or both."""
    words = dict.fromkeys("force" if unit == "N" else "torque" for unit in units)
    return " or ".join(sorted(words, reverse=True))


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """Return a number and its unit; the unit of a ratio, 1, is not written."""
    return f"{value:.{digits}g}" if unit == "1" else f"{value:.{digits}g} {unit}"


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """Return a value and its interval in steps of at most twice the interval's width.

    Finer where the ends would read the same, and with two digits of the larger end at least.
    """
    width, digits, places = abs(high - low), 4, 7
    if 0.0 < width < _LONG:
        two = 1 - math.floor(math.log10(max(abs(low), abs(high))))
        digits, places = 6, max(0, two, math.ceil(-math.log10(2.0 * width)))
        places += f"{low:.{places}f}" == f"{high:.{places}f}"

    def shown(x: float) -> str:
        return plain(x, digits) if places > 6 else f"{x:.{places}f}".replace("-", "−")

    return shown(value), f"{shown(low)} … {shown(high)}"


def with_deviation(value: float, deviation: float) -> str:
    """Return a difference with its sign and standard error, both to two digits of the error."""
    known = math.isfinite(value) and math.isfinite(deviation) and deviation > 0.0
    places = 1 - math.floor(math.log10(deviation)) if known else 7
    if places > 6:
        told = plain(value, 2 if known else 3)
        return f"{'+' if value > 0.0 else ''}{told} ± {plain(deviation, 2)}"
    near, error = round(value, places), round(deviation, places)
    places -= error >= 10.0 ** (2 - places)  # 99.6 became 100
    shown = max(places, 0)
    told = f"{near:+,.{shown}f}" if near else "0"
    return f"{told} ± {error:,.{shown}f}".replace("-", "−")


def sure(probability: float) -> str:
    """Return the probability that a cause is there; nothing is quite certain."""
    percent = round(100.0 * probability)
    return "> 99 % sure" if percent >= 100 else f"{percent} % sure"


def told(error: float) -> str:
    """Return a simulated position's error in two digits; "lost" where the simulation left."""
    if error != error:
        return "-"
    if abs(error) < _NONE:
        return "0"
    return plain(error, 2) if abs(error) < _LOST else "lost"


def provenance(sources: Sequence[LogSource], command: str = "") -> dict[str, Any]:
    """Return versions and the hashes of the logs; equal for equal results.

    Args:
        sources: of the logs.
        command: how to run it again; left out when empty.
    """
    facts: dict[str, Any] = {"command": command} if command else {}
    facts["logs"] = [
        {"file": s.path, "part": s.part, "columns": s.mapping, "sha256": s.sha256} for s in sources
    ]
    facts["versions"] = {name: _version(name) for name in _PACKAGES}
    facts["python"] = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return facts


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "?"
