"""A table as texts, for a terminal, a page or a notebook."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TextTable:
    """A table.

    Attributes:
        heads: of the columns; numbers stand under a head that begins with ">", at the right, and
            the texts under one that begins with "~" may be broken anywhere.
        cells: texts by row; missing ones at the end of a row are empty.
        title: above the table.
        caption: what its columns are.
        whole: whether no cell is broken but those under "~".
    """

    heads: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    title: str = ""
    caption: str = ""
    whole: bool = False
