"""Files that a command will write: refused before the work, not after it."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from wbc.errors import WbcError

_INPUTS = ("run_file", "robot", "columns", "ghost", "index", "fleet")
_ENDINGS = {
    "html": (".html", ".htm"),
    "report": (".html", ".htm"),
    "png": (".png",),
    "gif": (".gif", ".mp4"),
    "save": (".toml",),
    "out": (),  # each command says which: a table of results or a path
    "file": (".xml", ".urdf", ".py"),
    "fix": (".toml",),
    "json": (),
}


def require_outputs(options: argparse.Namespace) -> None:
    """Check that every file that the options name can be written.

    Args:
        options: of the command; those that name files are looked at where it has them.

    Raises:
        WbcError: a wrong ending, a folder in the place of a file, a file in the place of a folder,
            a place without permission, an input, or one file for two results.
    """
    named = [getattr(options, option, None) for option in _INPUTS]
    inputs = [name for name in [*named, *getattr(options, "logs", [])] if name]
    taken = {Path(name).resolve(): f"the input '{name}'" for name in inputs}
    for option, endings in _ENDINGS.items():
        name = getattr(options, option, None)
        if name is None or (option == "json" and name == "-"):
            continue
        path = Path(name)
        if endings and path.suffix.lower() not in endings:
            raise WbcError(f"--{option} '{name}': the name must end in {' or '.join(endings)}.")
        if path.is_dir():
            raise WbcError(f"--{option} '{name}' is a folder; name a file in it.")
        if path.resolve() in taken:
            raise WbcError(f"--{option} would overwrite {taken[path.resolve()]}; choose another.")
        taken[path.resolve()] = f"what --{option} writes"
        _require_folder(path.parent, f"--{option} '{name}'")
    if getattr(options, "figures", None):
        _require_folder(Path(options.figures), f"--figures '{options.figures}'")


def require_parquet(out: str | None) -> None:
    """Check that the file of a table of results ends in .parquet.

    Raises:
        WbcError: it does not.
    """
    if out is not None and Path(out).suffix.lower() != ".parquet":
        raise WbcError(f"--out '{out}': the name must end in .parquet.")


def _require_folder(folder: Path, asker: str) -> None:
    """Check that files can be made in a folder, or the folder itself; missing ones are made."""
    known = folder
    while not known.exists():
        known = known.parent
    if not known.is_dir():
        raise WbcError(f"{asker}: '{known}' is a file, not a folder.")
    if not os.access(known, os.W_OK | os.X_OK):
        raise WbcError(f"{asker}: no permission to write in '{known}'.")
