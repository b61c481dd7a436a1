"""Numbers as people read them, and as deep as they are known."""

from __future__ import annotations

import math
from collections.abc import Iterable

_LONG = 1e6  # width from which on an interval is written with exponents
_LOST = 1e3  # [rad, m] error from which a simulation has left the log
_NONE = 1e-6  # [rad, m] finer than an encoder of 22 bits: nothing moved


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

    Finer where the ends would read the same.
    """
    width = abs(high - low)
    if not 0.0 < width < _LONG:
        return plain(value, 4), f"{plain(low, 4)} … {plain(high, 4)}"
    places = max(0, math.ceil(-math.log10(2.0 * width)))
    if f"{low:.{places}f}" == f"{high:.{places}f}":
        places += 1
    if places > 6:
        return plain(value, 6), f"{plain(low, 6)} … {plain(high, 6)}"
    texts = [f"{number:.{places}f}".replace("-", "−") for number in (value, low, high)]
    return texts[0], f"{texts[1]} … {texts[2]}"


def with_deviation(value: float, deviation: float) -> str:
    """Return a difference with its sign and standard error, both to two digits of the error."""
    if not (math.isfinite(value) and math.isfinite(deviation) and deviation > 0.0):
        return f"{'+' if value > 0.0 else ''}{plain(value)} ± {plain(deviation, 2)}"
    places = 1 - math.floor(math.log10(deviation))
    if places > 6:
        return f"{'+' if value > 0.0 else ''}{plain(value, 2)} ± {plain(deviation, 2)}"
    near, error = round(value, places), round(deviation, places)
    if error >= 10.0 ** (2 - places):  # 99.6 became 100
        places -= 1
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
