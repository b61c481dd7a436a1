"""Where robot descriptions are found: by name among the shipped ones, or by path."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pinocchio as pin

from wbc.errors import RobotError, unknown_name

_PACKAGE = Path(__file__).resolve().parents[1]
_SOURCES = (_PACKAGE / "_robots", _PACKAGE.parent / "robots")


def robots_directory() -> Path:
    """Return the folder of the shipped robots (inside the wheel, or beside `wbc` in a checkout).

    Raises:
        RobotError: the installation lacks the folder.
    """
    for folder in _SOURCES:
        if folder.is_dir():
            return folder
    raise RobotError("the shipped robots are missing from this installation; reinstall wbc.")


def robot_names() -> tuple[str, ...]:
    """Return the names of the shipped robots."""
    return tuple(sorted(p.parent.name for p in robots_directory().glob("*/robot.toml")))


def find_description(name: str | Path) -> Path:
    """Return the TOML file that describes a robot.

    Args:
        name: a shipped robot's name, a TOML file, or a folder that holds `robot.toml`.

    Raises:
        RobotError: nothing of that name; the message lists the shipped robots.
    """
    path = Path(name)
    if path.suffix == ".toml":
        if path.is_file():
            return path
        raise RobotError(f"no robot description at '{path}'.")
    if (path / "robot.toml").is_file():
        return path / "robot.toml"
    shipped = robots_directory() / str(name) / "robot.toml"
    if str(name) in robot_names():
        return shipped
    raise RobotError(
        unknown_name("robot", str(name), robot_names()) + " Or give the path of a robot.toml."
    )


def find_model(reference: str, folder: Path) -> Path:
    """Return the URDF or MJCF file that a description refers to.

    Args:
        reference: a path relative to the description, or `package:path` for a file inside an
            installed Python package (for example `example_robot_data:robots/...`).
        folder: folder of the description.

    Raises:
        RobotError: no such file or package.
    """
    if ":" not in reference:
        path = (folder / reference).resolve()
        if not path.is_file():
            raise RobotError(f"the model file '{reference}' is not in '{folder}'.")
        return path
    package, inner = reference.split(":", 1)
    for root in _package_roots(package):
        candidate = root / inner
        if candidate.is_file():
            return candidate
    raise RobotError(
        f"the model '{inner}' of package '{package}' is not installed; "
        f"install it with: pip install {package.replace('_', '-')}"
    )


def _package_roots(package: str) -> list[Path]:
    """Return folders in which a data package may keep its files.

    Wheels built with cmeel put them under a shared prefix instead of a package of their own.
    """
    spec = find_spec(package) if package.isidentifier() else None
    own = list(spec.submodule_search_locations or []) if spec is not None else []
    prefix = Path(pin.__file__).resolve().parents[4] / "share" / package.replace("_", "-")
    return [*map(Path, own), prefix]
