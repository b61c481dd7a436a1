"""Every link of the pages leads to a file that is there, and to its title; so do pictures."""

import re
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CHANGELOG.md")),
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts),
    *sorted((ROOT / "robots").rglob("*.md")),
]
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's titles, as GitHub and the site make them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#{1,3} (.*)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", title.lower()) for title in titles)
    return {title.strip().replace(" ", "-") for title in plain}


@pytest.mark.parametrize("page", PAGES, ids=[str(p.relative_to(ROOT)) for p in PAGES])
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_every_page_stands_in_the_contents_of_the_site() -> None:
    docs, listed = ROOT / "docs", set()
    for page in docs.rglob("*.md"):
        for tree in re.findall(r"^```\{toctree\}(.*?)^```", page.read_text("utf-8"), re.M | re.S):
            entries = [re.sub(r"^.*<(.*)>$", r"\1", line) for line in tree.splitlines()]
            listed |= {(page.parent / f"{e}.md").resolve() for e in entries if e}
    pages = {path.resolve() for path in docs.rglob("*.md") if "_build" not in path.parts}
    assert pages - listed == {(docs / "index.md").resolve()}


def test_links_of_the_changelog_hold_on_the_site_too() -> None:
    """The page includes a file of another folder: its links were dead, which stopped the build."""
    assert ":relative-docs: docs/" in (ROOT / "docs" / "changelog.md").read_text("utf-8")


IMAGES = ROOT / "docs" / "images"
SHOWN = re.compile(r"!\[([^\]]*)\]\((?:docs/|(?:\.\./)*)images/([^)]+)\)")


def shown() -> dict[str, str]:
    """Return file name -> what the page says that it shows."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    return {name: text for page in pages for text, name in SHOWN.findall(page.read_text("utf-8"))}


def test_pictures_and_pages_belong_together() -> None:
    made = {path.name for path in IMAGES.iterdir()}
    dark = {name for name in made if Path(name).stem.endswith("_dark")}
    assert set(shown()) == made - dark
    # The site shows `name_dark.png` in the place of `name.png` on a dark page.
    assert {name.replace("_dark", "") for name in dark} <= set(shown())


def test_every_picture_is_made_opens_and_has_words_for_those_who_cannot_see_it() -> None:
    script = (ROOT / "docs" / "pictures.py").read_text("utf-8")
    for name, text in shown().items():
        assert f'"{Path(name).stem}"' in script
        with Image.open(IMAGES / name) as picture:
            picture.verify()
            assert min(picture.size) >= 200
        assert len(text.split()) >= 3
