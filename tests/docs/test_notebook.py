"""The notebook runs, and answers show themselves in it, in a console and as frames."""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from wbc.errors import MissingPackageError
from wbc.identification import Comparison, Diagnosis
from wbc.samples import sample_paths

NOTEBOOK = Path(__file__).resolve().parents[2] / "notebooks" / "first_answer.ipynb"


def run_cell(source: str, namespace: dict[str, Any]) -> Any:
    """Run a cell as a notebook does; return the value of its last line, if that is one."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, str(NOTEBOOK), "exec"), namespace)
    if last is None:
        return None
    assert isinstance(last, ast.Expr)
    return eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), namespace)


@pytest.fixture(scope="module")
def shown() -> list[Any]:
    namespace: dict[str, Any] = {"__name__": "notebook"}
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return [run_cell("".join(c["source"]), namespace) for c in cells if c["cell_type"] == "code"]


@pytest.fixture(scope="module")
def found(shown: list[Any]) -> Diagnosis:
    return next(value for value in shown if isinstance(value, Diagnosis))


def test_the_notebook_finds_what_the_sample_logs_hide(shown: list[Any], found: Diagnosis) -> None:
    keys = {effect.key for effect in found.effects}
    assert keys == {("transmission_efficiency", "knee"), ("coulomb_friction", "hip")}
    before, after = (value for value in shown if isinstance(value, Comparison))
    assert before.error > 30.0 > 1.5 > after.error


def test_answers_show_themselves(shown: list[Any], found: Diagnosis) -> None:
    for value in shown[1:]:
        html = getattr(value, "_repr_html_", lambda: "")()
        figure = hasattr(value, "savefig")
        assert figure or "<table>" in html
        if not figure:
            assert repr(value).splitlines()[0] == str(value).splitlines()[0]
            assert len(repr(value).splitlines()) <= 24
    assert "losses in the gear at knee (20 % when the motor drives" in found._repr_html_()
    assert "array(" not in repr(found)


def test_json_says_where_it_comes_from(found: Diagnosis) -> None:
    content = found.to_json()
    logs = content["provenance"]["logs"]
    assert [log["file"] for log in logs] == [str(path) for path in sample_paths()]
    assert all(len(log["sha256"]) == 64 for log in logs)
    assert content == found.to_json()
    names = content["correlation"]["parameters"]
    assert ["coulomb_friction", "hip", "level"] in names
    matrix = content["correlation"]["matrix"]
    assert [row[k] for k, row in enumerate(matrix)] == pytest.approx([1.0] * len(names))


def test_frames_need_pandas_and_say_so(found: Diagnosis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPackageError, match="pip install pandas"):
        found.to_frame()
    pandas = ModuleType("pandas")
    pandas.DataFrame = lambda rows: rows  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    rows = found.to_frame()
    assert {row["where"] for row in rows} == {"hip", "knee"}
    assert all(row["low"] < row["value"] < row["high"] for row in rows)


def test_frames_are_frames_where_pandas_is_there(found: Diagnosis) -> None:
    pandas = pytest.importorskip("pandas", reason="needs pandas: pip install pandas")
    assert isinstance(found.to_frame(), pandas.DataFrame)
