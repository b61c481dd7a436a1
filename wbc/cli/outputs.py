"""What a command prints and writes.

An answer on a screen: the answer itself, then as much of the detail as fits. What cannot be written
is refused before the work; files appear whole after it.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.segment import Segment, Segments
from rich.text import Text

from wbc.cli.options import OPTIONS
from wbc.errors import WbcError
from wbc.files import SCHEMA, write_text
from wbc.parallel import Watch, progress_bar, progress_lines

Options = argparse.Namespace
"""What the command line says, by the names in `OPTIONS`."""
Outcome = tuple[int, Mapping[str, Any]]
"""What a command returns: the exit code, and what --json writes."""


class PatientConsole(Console):
    """Where a command prints; when the reader leaves (wbc ... | head), it goes on in silence."""

    def on_broken_pipe(self) -> None:
        """Print nothing more, so that what the command writes to files is still written."""
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


_INPUTS = ("run_file", "robot", "columns", "ghost")
_OUTPUTS = ("--html", "--report", "--save", "--out", "--file", "--fix", "--json")


def require_outputs(options: Options, keys: Sequence[str]) -> None:
    """Check that every file that the options name can be written.

    Args:
        options: of the command.
        keys: those of its options in `OPTIONS`, where the name of each file has its ending.

    Raises:
        WbcError: a wrong ending, a folder in the place of a file, a file in the place of a folder,
            a place without permission, an input, or one file for two results.
    """
    named = [getattr(options, option, None) for option in _INPUTS]
    inputs = [name for name in [*named, *getattr(options, "logs", [])] if name]
    taken = {Path(name).resolve(): f"the input '{name}'" for name in inputs}
    for key in keys:
        option = key.partition("/")[0]
        name = getattr(options, option.removeprefix("--"), None)
        if option not in _OUTPUTS or name is None or (option == "--json" and name == "-"):
            continue
        path, ending = Path(name), Path(OPTIONS[key]["metavar"]).suffix
        if ending and path.suffix.lower() != ending:
            raise WbcError(f"{option} '{name}': the name must end in {ending}.")
        if path.is_dir():
            raise WbcError(f"{option} '{name}' is a folder; name a file in it.")
        if path.resolve() in taken:
            raise WbcError(f"{option} would overwrite {taken[path.resolve()]}; choose another.")
        taken[path.resolve()] = f"what {option} writes"
        _require_folder(path.parent, f"{option} '{name}'")
    if getattr(options, "figures", None):
        _require_folder(Path(options.figures), f"--figures '{options.figures}'")


def _require_folder(folder: Path, asker: str) -> None:
    """Check that files can be made in a folder, or the folder itself; missing ones are made."""
    known = next(place for place in (folder, *folder.parents) if place.exists())
    if not known.is_dir():
        raise WbcError(f"{asker}: '{known}' is a file, not a folder.")
    if not os.access(known, os.W_OK | os.X_OK):
        raise WbcError(f"{asker}: no permission to write in '{known}'.")


def write_json(target: str | None, content: Mapping[str, Any], console: Console) -> None:
    """Write `content`, with the version of its format, to a file; print it for a target '-'."""
    if target is None:
        return
    text = json.dumps({"schema": SCHEMA, **content}, indent=2, allow_nan=False) + "\n"
    if target == "-":
        PatientConsole().out(text, end="", highlight=False)
    else:
        console.print(f"wrote {write_text(Path(target), text)}")


def write_figures(
    options: Options, figures: Mapping[str, Callable[..., Any]], console: Console
) -> None:
    """Draw figures in the theme and write them to the folder that the options name.

    Args:
        options: with theme and folder.
        figures: names of files without ending, and what draws their figures, given a theme.
        console: where the files are named.
    """
    from wbc.view import DARK, LIGHT
    from wbc.view.plots import write_figure

    theme = DARK if options.theme == "dark" else LIGHT
    for name, draw in figures.items():
        path = write_figure(f"{options.figures}/{name}.png", draw(theme=theme))
        console.print(f"wrote {path}")


def watching(what: str, console: Console) -> AbstractContextManager[Watch]:
    """Return a bar with the time left; where there is no terminal, lines on standard error."""
    return progress_bar(what, console) if console.is_terminal else nullcontext(progress_lines(what))


@contextmanager
def working(console: Console, what: str) -> Iterator[Any]:
    """Show a spinner with a changing line while work goes on; silent when piped."""
    if not console.is_terminal:
        yield lambda line: None
        return
    with console.status(what) as status:
        yield lambda line: status.update(f"{what}: {line}")


def command_line() -> str:
    """Return the command as it was typed, for provenance."""
    return shlex.join(["wbc", *sys.argv[1:]])


LINES = 54
"""Of a printout that nobody asked to be longer; with the names of files written it is below 60."""
Part = tuple[str, RenderableType | Callable[[], RenderableType]]
"""A part of the detail: what is said to be missing where it does not fit, and what is printed if it
is not empty, texts as `spoken` has them. A function that returns it stands for what takes long: it
is called when all that comes before is printed, and not at all where the part is not printed."""


def spoken(text: str, indent: int = 0) -> Group:
    """Return a message whose indented lines are to be copied: they are never broken.

    Args:
        text: prose, and lines that begin with four spaces.
        indent: spaces before every line.
    """
    lines: list[RenderableType] = []
    for line in text.split("\n"):
        copied = Text(" " * indent + line, no_wrap=True, overflow="ignore")
        prose = Padding(line, (0, 0, 0, indent), expand=False)
        lines.append(copied if line.startswith("    ") else prose)
    return Group(*lines)


def print_out(
    console: Console, answer: Sequence[RenderableType], detail: Sequence[Part], verbose: bool
) -> None:
    """Print an answer, then its detail, the most important part first, until the screen is full.

    Args:
        console: where.
        answer: printed whole.
        detail: a part that does not fit whole is cut; the parts after it are named instead.
        verbose: print everything.
    """
    left, absent = LINES, list[str]()
    for name, content in (("", Group(*answer)), *detail):
        if not content:
            continue
        if absent and not verbose:  # no part is printed after one that did not fit
            absent.append(name)
            continue
        shown = content() if callable(content) else content
        shown = spoken(shown) if isinstance(shown, str) else shown
        lines = list(Segment.split_lines(console.render(shown)))
        whole = verbose or not name
        room = len(lines) if whole else max(left - 2, 0)  # for what is said of parts left out
        kept = lines if len(lines) <= room else lines[: room if room > 3 else 0]
        segments = [segment for line in kept for segment in (*line, Segment.line())]
        # Lines to copy are whole even where they are wider than the screen.
        console.print(Segments(segments), end="", crop=False)
        if len(kept) < len(lines):
            absent.append(f"the rest of {name}" if kept else name)
        left -= len(lines)
    if absent:
        names = ", ".join(dict.fromkeys(absent))
        console.print(f"not shown: {names} (--verbose, --json and --report have all)")
