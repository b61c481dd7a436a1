"""Sphinx configuration: `make docs` builds docs/_build."""

import re
from importlib.metadata import version as installed
from pathlib import Path

import latex2mathml.converter
from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

project = "wbc"
author = "the wbc authors"
copyright = "2026, the wbc authors"
release = version = installed("wbc")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "wbc"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
copybutton_exclude = ".linenos, .gp, .go"
# What a page says was printed is not for pasting.
copybutton_selector = "div:not(.highlight-text) > div.highlight > pre"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# Each field stands once: under Attributes, without the type that the signature gives already.
napoleon_use_ivar = True
python_maximum_signature_line_length = 80
autodoc_type_aliases = {name: name for name in ("ArrayLike", "FloatArray", "IntArray")}
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_google_docstring = True
napoleon_numpy_docstring = False


class DarkPictures(SphinxPostTransform):
    """Show `name_dark.png` in place of `name.png` on a dark page, where there is one."""

    default_priority = 9  # before the pictures are collected for copying
    formats = ("html",)

    def run(self, **kwargs):
        """Put the dark picture beside each light one."""
        for image in list(self.document.findall(nodes.image)):
            light = Path(self.app.srcdir) / image["uri"]
            dark = light.with_name(f"{light.stem}_dark{light.suffix}")
            if not dark.exists():
                continue
            other = image.deepcopy()
            other["uri"] = str(dark.relative_to(self.app.srcdir))
            other["candidates"] = {"*": other["uri"]}
            image["classes"].append("only-light")
            other["classes"].append("only-dark")
            image.parent.insert(image.parent.index(image) + 1, other)
            self.env.images.add_file(self.env.docname, other["uri"])


def _mathml(display):
    """Return what writes a formula as MathML, which browsers draw without a script."""

    def visit(self, node):
        source = node.astext().replace("{aligned}", "{align*}")  # the converter knows the latter
        text = latex2mathml.converter.convert(source, display=display)
        self.body.append(f'<div class="math">{text}</div>' if display == "block" else text)
        raise nodes.SkipNode

    return visit, None


def _escape_bars(app, what, name, obj, options, lines):
    """Keep |v| in an equation from being read as a substitution of reStructuredText."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def _skip_fields(app, what, name, obj, skip, options):
    """Leave the fields of a class to its docstring, which says what they are."""
    return True if type(obj).__name__ in ("_tuplegetter", "member_descriptor") else None


def _short_types(app, what, name, obj, options, signature, returns):
    """Name an alias of a type as the source does."""
    return tuple(
        text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text)
        for text in (signature, returns)
    )


def setup(app):
    """Connect the hooks."""
    app.add_html_math_renderer("mathml", _mathml("inline"), _mathml("block"))
    app.add_post_transform(DarkPictures)
    app.connect("autodoc-process-docstring", _escape_bars)
    app.connect("autodoc-process-signature", _short_types)
    app.connect("autodoc-skip-member", _skip_fields)
