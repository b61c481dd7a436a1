"""Run the notebooks and put what their cells show into them: `python docs/notebooks.py`.

No Jupyter is needed: the value of a cell's last line shows itself as HTML, as a picture or as text.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
from pathlib import Path
from typing import Any

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"


def run_cell(source: str, namespace: dict[str, Any]) -> tuple[str, Any]:
    """Run a cell; return what it prints and the value of its last line, None without one."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), namespace)
        value = (
            eval(compile(ast.Expression(last.value), "cell", "eval"), namespace) if last else None
        )
    return printed.getvalue(), value


def outputs(printed: str, value: Any, number: int) -> list[dict[str, Any]]:
    """Return what a notebook keeps of a cell."""
    found: list[dict[str, Any]] = []
    if printed:
        found.append({"output_type": "stream", "name": "stdout", "text": lines(printed)})
    if value is not None:
        data: dict[str, Any] = {"text/plain": lines(repr(value))}
        if hasattr(value, "_repr_html_") and (html := value._repr_html_()):
            data["text/html"] = lines(html)
        if hasattr(value, "_repr_png_"):
            data["image/png"] = base64.b64encode(value._repr_png_()).decode("ascii")
        found.append(
            {
                "output_type": "execute_result",
                "execution_count": number,
                "metadata": {},
                "data": data,
            }
        )
    return found


def lines(text: str) -> list[str]:
    """Return a text as notebooks keep it."""
    return text.splitlines(keepends=True)


def run(path: Path) -> list[Any]:
    """Run a notebook, write what it shows into it, and return the values of its cells."""
    book = json.loads(path.read_text(encoding="utf-8"))
    namespace: dict[str, Any] = {"__name__": "notebook"}
    values = []
    for number, cell in enumerate((c for c in book["cells"] if c["cell_type"] == "code"), 1):
        printed, value = run_cell("".join(cell["source"]), namespace)
        cell["execution_count"], cell["outputs"] = number, outputs(printed, value, number)
        values.append(value)
    path.write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return values


if __name__ == "__main__":
    for notebook in sorted(NOTEBOOKS.glob("*.ipynb")):
        run(notebook)
        print(notebook)
