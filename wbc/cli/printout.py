"""An answer on a screen: the answer itself, then as much of the detail as fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.segment import Segment, Segments
from rich.table import Table
from rich.text import Text

from wbc.tables import TextTable

LINES = 54
"""Of a printout that nobody asked to be longer; with the names of files written it is below 60."""


Shown = TextTable | RenderableType
"""What is empty is not printed; texts are, as `spoken` has them."""
Part = tuple[str, Shown | Callable[[], Shown]]
"""A part of the detail: what is said to be missing where it does not fit, and what is printed; or a
function that returns it, where that takes long: it is called when all that comes before is printed,
and not at all where the part is not printed."""


def spoken(text: str, indent: int = 0) -> Group:
    """Return a message whose indented lines are to be copied: they are never broken.

    Args:
        text: prose, and lines that begin with four spaces.
        indent: spaces before every line.
    """
    return Group(
        *(
            Text(" " * indent + line, no_wrap=True, overflow="ignore")
            if line.startswith("    ")
            else Padding(line, (0, 0, 0, indent), expand=False)
            for line in text.split("\n")
        )
    )


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
    lines = _lines(console, Group(*answer))
    _print(console, lines)
    if quiet:
        return
    left, absent = LINES - len(lines), list[str]()
    for name, content in detail:
        if not content:
            continue
        if absent and not verbose:  # no part is printed after one that did not fit
            absent.append(name)
            continue
        shown = content() if callable(content) else content
        shown = table(shown) if isinstance(shown, TextTable) else shown
        lines = _lines(console, spoken(shown) if isinstance(shown, str) else shown)
        room = len(lines) if verbose else max(left - 2, 0)  # for what is said of parts left out
        kept = lines if len(lines) <= room else lines[: room if room > 3 else 0]
        _print(console, kept)
        if len(kept) < len(lines):
            absent.append(f"the rest of {name}" if kept else name)
        left -= len(lines)
    if absent:
        names = ", ".join(dict.fromkeys(absent))
        console.print(f"not shown: {names} (--verbose, --json and --report have all)")


def _lines(console: Console, shown: RenderableType) -> list[list[Segment]]:
    return list(Segment.split_lines(console.render(shown)))


def _print(console: Console, lines: Sequence[Sequence[Segment]]) -> None:
    segments = [segment for line in lines for segment in (*line, Segment.line())]
    # Lines to copy are whole even where they are wider than the screen.
    console.print(Segments(segments), end="", crop=False)
