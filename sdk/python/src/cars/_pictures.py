"""Pictures and pages that a notebook shows in their place."""

from __future__ import annotations

import html
import os
from pathlib import Path
from typing import Union


class _Document:
    """A text that is shown."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"<{type(self).__name__}, {len(self._text)} characters; save() writes it to a file>"

    def save(self, file: Union[str, os.PathLike[str]]) -> None:
        """Writes it to a file."""
        Path(file).write_text(self._text, encoding="utf-8")


class Page(_Document):
    """A page, HTML that needs no other file: ``str(page)``."""

    def _repr_html_(self) -> str:
        # In a frame of its own: its style is not for the notebook, nor the notebook's for it.
        fit = "this.style.height = this.contentDocument.documentElement.scrollHeight + 16 + 'px'"
        page = html.escape(self._text)
        return f'<iframe srcdoc="{page}" onload="{fit}" style="width: 100%; height: 30em; border: none"></iframe>'


class Picture(_Document):
    """A picture, SVG: ``str(picture)``."""

    def _repr_svg_(self) -> str:
        return self._text
