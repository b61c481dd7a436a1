"""The notebook runs, and answers show themselves in it and in a console."""

import ast
import base64
import json
from pathlib import Path
from typing import Any

import pytest

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


def cells(name: str) -> list[tuple[str, list[Any]]]:
    """Return source and kept outputs of each cell of code of a notebook."""
    stored = json.loads(NOTEBOOK.with_stem(name).read_text(encoding="utf-8"))["cells"]
    return [("".join(c["source"]), c["outputs"]) for c in stored if c["cell_type"] == "code"]


@pytest.fixture(scope="module")
def shown() -> list[Any]:
    namespace: dict[str, Any] = {"__name__": "notebook"}
    return [run_cell(source, namespace) for source, _ in cells("first_answer")]


@pytest.fixture(scope="module")
def found(shown: list[Any]) -> Diagnosis:
    return next(value for value in shown if isinstance(value, Diagnosis))


def test_the_notebook_finds_what_the_sample_logs_hide(shown: list[Any], found: Diagnosis) -> None:
    keys = {effect.key for effect in found.effects}
    assert keys == {("transmission_efficiency", "knee"), ("coulomb_friction", "hip")}
    before, after = (value for value in shown if isinstance(value, Comparison))
    assert before.error > 30.0 > 1.5 > after.error


@pytest.mark.parametrize("name", ["first_answer", "quadruped"])
def test_a_notebook_holds_what_its_cells_show(name: str) -> None:
    """Its plots were printed as the names of figures, and nothing was kept."""
    kept = [out for _, outputs in cells(name) for out in outputs]
    pictures = [o["data"]["image/png"] for o in kept if "image/png" in o.get("data", {})]
    assert pictures
    for picture in pictures:
        assert base64.b64decode(picture).startswith(b"\x89PNG")


def test_the_quadruped_of_the_notebook_squats() -> None:
    pytest.importorskip("example_robot_data")
    namespace: dict[str, Any] = {"__name__": "notebook"}
    sources = (cell.replace(", 2.0)", ", 0.2)") for cell, _ in cells("quadruped"))
    figures = [run_cell(source, namespace) for source in sources]
    assert figures[-1]._repr_png_().startswith(b"\x89PNG")
    height = namespace["run"].log.column("base.position.z")
    # After 0.2 s the centre of mass is to be 0.02 (1 - cos(0.4 pi)) m lower.
    assert height[0] - height[-1] == pytest.approx(0.0138, abs=0.002)


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
