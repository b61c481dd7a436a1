"""Tables of texts, which terminal, page and notebook show alike; lists of names in sentences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.table import Table

FEW = 3
"""Things that a sentence names before it counts the rest; tables hold all."""


def few(names: Sequence[str], most: int = FEW) -> str:
    """Return the first names of some, and how many more there are: `a, b, c and 2 more`."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def joined(parts: Sequence[str]) -> str:
    """Return parts as English joins them: `a, b and c`."""
    *first, last = parts or [""]
    return f"{', '.join(first)} and {last}" if first else last


@dataclass(frozen=True)
class TextTable:
    """A table.

    Attributes:
        heads: of the columns; numbers stand under a head that begins with ">", at the right.
        cells: texts by row; missing ones at the end of a row are empty.
        title: above the table.
        caption: what its columns are.
        whole: whether no cell is broken but those under a head that begins with "~".
    """

    heads: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    title: str = ""
    caption: str = ""
    whole: bool = False

    @classmethod
    def of(
        cls, heads: str, cells: Iterable[Sequence[str]], title: str = "", caption: str = ""
    ) -> TextTable:
        """Return a table; its heads are separated by a bar."""
        return cls(tuple(heads.split("|")), tuple(map(tuple, cells)), title, caption)

    def __bool__(self) -> bool:
        """Whether it has rows."""
        return bool(self.cells)

    @property
    def names(self) -> list[str]:
        """The heads as they are read."""
        return [head.lstrip(">~") for head in self.heads]

    def __str__(self) -> str:
        """Return the table as lines of text."""
        rows = [[*row, *[""] * (len(self.heads) - len(row))] for row in (self.names, *self.cells)]
        # A text that stands alone in its row takes what room it needs.
        own = [[cell if any(row[1:]) else "" for cell in row] for row in rows]
        widths = [max(map(len, column)) for column in zip(*own, strict=True)]
        ways = [">" if head.startswith(">") else "<" for head in self.heads]
        lines = []
        for row in rows:
            cells = (f"{cell:{way}{n}}" for cell, way, n in zip(row, ways, widths, strict=True))
            lines.append(f"  {'  '.join(cells)}".rstrip())
        return "\n".join(lines)

    def __rich__(self) -> Table:
        """Return the table as a terminal shows it, without lines between its cells."""
        from rich.table import Table  # only a terminal needs it

        made = Table(box=None, title=self.title or None, caption=self.caption or None)
        for head, name in zip(self.heads, self.names, strict=True):
            side: Literal["left", "right"] = "right" if head.startswith(">") else "left"
            unbroken = self.whole and not head.startswith("~")
            made.add_column(name, justify=side, overflow="fold", no_wrap=unbroken)
        for row in self.cells:
            made.add_row(*row)
        return made

    def html(self) -> str:
        """Return the table as HTML; every cell is escaped."""
        head = "".join(f"<th>{escape(name)}</th>" for name in self.names)
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self.cells)
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
