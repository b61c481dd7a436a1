"""The exception family. Every error names the thing, the place and the way out.

And packages that a bare installation does not have, with the extra of `wbc` that brings each.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches


class WbcError(Exception):
    """Base of every error that this library raises on purpose."""


class RobotError(WbcError):
    """A robot description is unknown, unreadable or inconsistent."""


class TransmissionError(WbcError):
    """A reduction, topology, inertia or efficiency is outside its range."""


class EffectError(WbcError):
    """A physical effect is unknown, misplaced or has a parameter outside its range."""


class DynamicsError(WbcError):
    """A quantity of the equation of motion does not exist here (singular pose, wrong base)."""


class ControlError(WbcError):
    """A controller is set up in a way that cannot work; never raised inside the loop."""


class SimulationError(WbcError):
    """A time step has no solution, or several."""


class LogError(WbcError):
    """A log is unreadable, incomplete or contradicts itself."""


class DesignError(WbcError):
    """A design study asks for what does not exist."""


class IdentificationError(WbcError):
    """Logs and robot cannot be compared, or hold too little to identify anything."""


class ParallelError(WbcError):
    """Work cannot be shared out as it was asked for."""


class MissingPackageError(WbcError, ImportError):
    """A package that a bare installation does not have is needed."""


class ViewError(WbcError):
    """Something needed to draw or to take a picture is missing."""


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message for a name that does not exist, with the names that do."""
    names = list(known)
    near = get_close_matches(name, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    listed = ", ".join(names) if names else "(none)"
    return f"Unknown {kind} '{name}'.{hint} There are: {listed}."


def require_known(
    error: type[WbcError], kind: str, name: str, known: Collection[str], place: str = ""
) -> None:
    """Raise an error unless a name exists; its message lists the names that do.

    Args:
        error: its class.
        kind: what the name is of, such as "joint".
        name: as it was given.
        known: the names that there are.
        place: file and key, or what else the message begins with; a colon follows it.

    Raises:
        WbcError: of that class.
    """
    if name not in known:
        raise error((f"{place}: " if place else "") + unknown_name(kind, name, known))


EXTRAS = {
    "logs": ("pyarrow",),
    "rosbags": ("rosbags",),
    "design": ("joblib", "pyarrow"),
    "view": ("meshcat", "matplotlib", "plotly", "jinja2"),
    "pictures": ("playwright",),
    "cli": ("rich",),
}
"""Extra -> what pip installs for it, called as this library imports it. The names of the packages
work beside a clone and beside a wheel; `wbc` itself is on no index."""

BROUGHT = {"umsgpack": "meshcat", "mpl_toolkits": "matplotlib", "PIL": "matplotlib"}
"""Imported package -> the one that brings it."""


@contextmanager
def needs(extra: str, what: str) -> Iterator[None]:
    """Turn an import of a package that is not installed into a message with the way out.

    Args:
        extra: of `wbc`, a key of `EXTRAS`.
        what: that needs the package, as the subject of a sentence.

    Raises:
        MissingPackageError: a package of the extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as cause:
        package = (cause.name or "").partition(".")[0]
        if BROUGHT.get(package, package) not in EXTRAS[extra]:
            raise
        raise MissingPackageError(
            f"{what} needs the package {package}, which a bare installation does not have; "
            f"install it with: pip install {' '.join(EXTRAS[extra])}"
        ) from cause
