"""Printing the figures of several runs side by side."""

from __future__ import annotations

from collections.abc import Mapping

from rich.console import Console
from rich.table import Table


def print_columns(title: str, columns: Mapping[str, Mapping[str, float]]) -> None:
    """Print a table with one column per run and one row per figure that the first run has."""
    table = Table("", *columns, title=title, box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    for figure in next(iter(columns.values())):
        table.add_row(figure, *(f"{values[figure]:.4g}" for values in columns.values()))
    Console(markup=False, highlight=False).print(table)
