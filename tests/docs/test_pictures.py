"""No page shows a picture that is not there, and no picture is left that no page shows."""

from __future__ import annotations

import re
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
SHOWN = re.compile(r"!\[([^\]]*)\]\((?:docs/|(?:\.\./)*)images/([^)]+)\)")


def shown() -> dict[str, str]:
    """Return file name -> what the page says that it shows."""
    docs = ROOT / "docs"
    pages = [ROOT / "README.md", *docs.rglob("*.md")]
    return {name: text for page in pages for text, name in SHOWN.findall(page.read_text("utf-8"))}


def test_pictures_and_pages_belong_together() -> None:
    made = {path.name for path in IMAGES.iterdir()}
    dark = {name for name in made if Path(name).stem.endswith("_dark")}
    assert set(shown()) == made - dark
    # The site shows `name_dark.png` in the place of `name.png` on a dark page.
    assert {name.replace("_dark", "") for name in dark} <= set(shown())


def test_every_picture_is_one_that_the_script_makes() -> None:
    script = (ROOT / "docs" / "pictures.py").read_text("utf-8")
    for name in shown():
        assert f'"{Path(name).stem}"' in script


def test_every_picture_opens_and_has_words_for_those_who_cannot_see_it() -> None:
    for name, text in shown().items():
        with Image.open(IMAGES / name) as picture:
            picture.verify()
            assert min(picture.size) >= 200
        assert len(text.split()) >= 3
