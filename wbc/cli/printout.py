"""An answer on a screen: the answer itself, then as much of the detail as fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderableType
from rich.padding import Padding
from rich.segment import Segment, Segments
from rich.table import Table

from wbc.tables import TextTable

LINES = 54
"""Of a printout that nobody asked to be longer; with the names of files written it is below 60."""


@dataclass(frozen=True)
class Part:
    """A part of the detail.

    Attributes:
        name: what is said to be missing where it does not fit.
        shown: what is printed; or a function that returns it, where that takes long: it is called
            when all that comes before is printed, and not at all where the part is not printed.
    """

    name: str
    shown: RenderableType | Callable[[], RenderableType]


@dataclass(frozen=True)
class Spoken:
    """A message whose indented lines are to be copied: they are never broken.

    Attributes:
        text: prose, and lines that begin with four spaces.
        indent: spaces before every line.
    """

    text: str
    indent: int = 0

    def __rich_console__(
        self, console: Console, options: ConsoleOptions
    ) -> Iterator[RenderableType | Segment]:
        """Yield the prose wrapped, and the other lines whole."""
        for line in self.text.split("\n"):
            if line.startswith("    "):
                yield Segment(" " * self.indent + line)
                yield Segment.line()
            else:
                yield Padding(line, (0, 0, 0, self.indent), expand=False)


def table(rows: TextTable) -> Table:
    """Return rows as a table without lines between its cells."""
    made = Table(box=None, title=rows.title or None, caption=rows.caption or None)
    for head in rows.heads:
        made.add_column(
            head.lstrip(">~"),
            justify="right" if head.startswith(">") else "left",
            overflow="fold" if head.startswith("~") else "ellipsis",
            no_wrap=rows.whole and not head.startswith("~"),
        )
    for row in rows.cells:
        made.add_row(*row)
    return made


def print_out(
    console: Console,
    answer: Sequence[RenderableType],
    detail: Sequence[Part],
    *,
    quiet: bool = False,
    verbose: bool = False,
) -> None:
    """Print an answer, then its detail, the most important part first, until the screen is full.

    Args:
        console: where.
        answer: printed whole.
        detail: a part that does not fit whole is cut; the parts after it are named instead.
        quiet: print the answer alone.
        verbose: print everything.
    """
    left = LINES
    for one in answer:
        lines = _lines(console, one)
        left -= len(lines)
        _print(console, lines)
    if quiet:
        return
    absent: list[str] = []
    for part in detail:
        if absent and not verbose:  # no part is printed after one that did not fit
            absent.append(part.name)
            continue
        shown = part.shown() if callable(part.shown) else part.shown
        lines = _lines(console, shown)
        room = len(lines) if verbose else max(left - 2, 0)  # for what is said of parts left out
        kept = lines if len(lines) <= room else lines[: room if room > 3 else 0]
        _print(console, kept)
        if len(kept) < len(lines):
            absent.append(f"the rest of {part.name}" if kept else part.name)
        left -= len(lines)
    if absent:
        names = ", ".join(dict.fromkeys(absent))
        console.print(f"not shown: {names} (--verbose, --json and --report have all)")


def _lines(console: Console, shown: RenderableType) -> list[list[Segment]]:
    if isinstance(shown, Spoken):
        return list(Segment.split_lines(console.render(shown)))
    return console.render_lines(shown, pad=False)


def _print(console: Console, lines: Sequence[Sequence[Segment]]) -> None:
    segments = [segment for line in lines for segment in (*line, Segment.line())]
    # Lines to copy are whole even where they are wider than the screen.
    console.print(Segments(segments), end="", crop=False)
