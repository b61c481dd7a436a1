"""Reading a part of a table of results."""

from __future__ import annotations

from pathlib import Path

from wbc.results import Column, ResultTable, read_results


def test_only_the_named_columns_are_read(tmp_path: Path) -> None:
    columns = {"machine": Column(kind="text"), "diagnosis": Column(kind="text")}
    table = ResultTable(tmp_path / "fleet.parquet", {}, columns, 1)
    table.begin()
    table.add(0, {"machine": ["a", "b"], "diagnosis": ["long", "longer"]})
    path = table.finish()
    assert read_results(path, ["machine"]) == {"machine": ["a", "b"]}
    assert set(read_results(path)) == set(columns)
