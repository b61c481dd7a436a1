"""Importing the room loads nothing that only a picture needs."""

from __future__ import annotations

import subprocess
import sys

import pytest

import wbc.view


def test_every_public_name_is_there_and_no_other() -> None:
    for name in wbc.view.__all__:
        assert getattr(wbc.view, name) is not None
    assert dir(wbc.view) == sorted(wbc.view.__all__)
    with pytest.raises(AttributeError, match="write_film"):
        wbc.view.write_film  # noqa: B018


def test_the_room_and_its_themes_load_neither_meshcat_nor_matplotlib() -> None:
    code = (
        "import sys, wbc.view; wbc.view.LIGHT; "
        "heavy = ('meshcat', 'matplotlib', 'plotly', 'jinja2', 'PIL'); "
        "print([name for name in heavy if name in sys.modules])"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
