"""Packages that a bare installation does not have, and the extra of `wbc` that brings each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from wbc.errors import MissingPackageError

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
