"""Sphinx configuration: `make docs` builds docs/_build."""

from importlib.metadata import version as installed

project = "wbc"
author = "the wbc authors"
copyright = "2026, the wbc authors"
release = version = installed("wbc")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "wbc"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
myst_heading_anchors = 3


def _escape_bars(app, what, name, obj, options, lines):
    """Keep |v| in an equation from being read as a substitution of reStructuredText."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def _skip_tuple_fields(app, what, name, obj, skip, options):
    """Leave the fields of named tuples to their class's docstring, which says what they are."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def setup(app):
    """Connect the hooks."""
    app.connect("autodoc-process-docstring", _escape_bars)
    app.connect("autodoc-skip-member", _skip_tuple_fields)
