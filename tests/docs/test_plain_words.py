"""Pages for users: plain words, at most about two screens, terms linked where they first stand."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
# What somebody reads who is new; measurements, history and methods have pages of their own.
NEWCOMERS = [
    "../README",
    "index",
    "reference/command-line",
    *(f"{page.parent.name}/{page.stem}" for page in sorted(DOCS.glob("[dg][iu]*/*.md"))),
]
TWO_SCREENS = 900  # words of prose: two windows of a 27-inch display hold about 1000
TERMS = {
    "noise-floor": "noise floor",
    "held-out": "held[- ]out",
    "mesh-power": "mesh power",
    "backward": "backward",
    "git": "GIT",
    "rollout": "rollout",
    "imf": "impact mitigation factor",
}
RIDDLES = re.compile(
    r"what pays|on no list|the wish, not the deed|text slips|who drives whom|rests teaches"
    r"|not a clock",
    re.IGNORECASE,
)
CODE = re.compile(r"^```.*?^```$|^\$\$.*?^\$\$$|^    .*?$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[([^\]]*)\]\(([^)]*)\)")


def prose(page: str) -> str:
    """Return a page without code, formulas, titles and pictures."""
    text = CODE.sub(" ", (DOCS / f"{page}.md").read_text("utf-8"))
    return re.sub(r"^#.*$|!\[[^\]]*\]\([^)]*\)", " ", text, flags=re.MULTILINE)


@pytest.mark.parametrize("page", NEWCOMERS)
def test_a_page_for_newcomers_fits_two_screens(page: str) -> None:
    assert len(LINK.sub(r"\1", prose(page)).split()) <= TWO_SCREENS


@pytest.mark.parametrize("page", NEWCOMERS)
def test_a_term_is_linked_to_the_glossary_where_it_first_stands(page: str) -> None:
    text = prose(page)
    for anchor, term in TERMS.items():
        first = re.search(rf"\b{term}", text, re.IGNORECASE if term.islower() else 0)
        if first is None:
            continue
        links = [m for m in LINK.finditer(text) if m.start() <= first.start() < m.end()]
        assert links, f"{page}: '{first.group()}' is no link at its first use"
        assert "glossary" in links[0].group(2), f"{page}: {links[0].group()}"
        assert anchor in links[0].group(2) or "efficiency" in links[0].group(2)


def test_every_term_stands_in_the_glossary_which_is_sorted() -> None:
    glossary = (DOCS / "reference" / "glossary.md").read_text("utf-8")
    titles = re.findall(r"^## (.*)$", glossary, re.MULTILINE)
    assert set(TERMS) <= {title.lower().replace(" ", "-") for title in titles}
    assert titles == sorted(titles, key=str.lower)


def test_nothing_is_said_in_riddles() -> None:
    places = [ROOT / "README.md", *DOCS.rglob("*.md")]
    places += [*(ROOT / "wbc").rglob("*.py"), *(ROOT / "sims").rglob("*.py")]
    for place in places:
        assert not RIDDLES.search(place.read_text("utf-8")), place
