"""A name stands for one thing: no two classes of the library share theirs."""

import ast
from collections import defaultdict
from pathlib import Path

from wbc import sim

LIBRARY = Path(__file__).resolve().parents[1] / "wbc"


def test_every_class_name_stands_once() -> None:
    homes = defaultdict(list)
    for path in LIBRARY.rglob("*.py"):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(str(path.relative_to(LIBRARY)))
    assert len(homes) > 300
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}


def test_no_folder_holds_more_files_than_a_reader_takes_in_at_once() -> None:
    folders = [path for path in (LIBRARY, *LIBRARY.rglob("*")) if path.is_dir()]
    crowded = {str(path): len(list(path.glob("*.py"))) for path in folders}
    assert {path: count for path, count in crowded.items() if count > 22} == {}


def test_every_name_that_the_plant_offers_is_there() -> None:
    """They are loaded when they are first used, from files that may move."""
    assert [name for name in sim.__all__ if not hasattr(sim, name)] == []
