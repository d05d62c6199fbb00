"""Pictures and pages that a notebook shows in their place."""

from __future__ import annotations

import html
import os
import tempfile
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
        """Writes it to a file, which is complete when it has its name."""
        path = Path(os.path.realpath(file))
        if str(file).startswith(("/dev/", "/proc/")) or (path.exists() and not path.is_file()):
            with open(file, "a", encoding="utf-8") as stream:
                stream.write(self._text)
            return

        handle, draft = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".draft", dir=path.parent)
        try:
            with open(handle, "w", encoding="utf-8") as written:
                written.write(self._text)
            # The permissions of any other file: those of the one that is replaced, or what the user's mask leaves.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(draft, path.stat().st_mode & 0o7777 if path.exists() else 0o666 & ~mask)
            os.replace(draft, path)
        except BaseException:
            os.unlink(draft)
            raise


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
