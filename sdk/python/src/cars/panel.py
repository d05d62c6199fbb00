"""What a robot chooses to display: data, not code. A console draws it and knows no robot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Literal, Union

MAX_TEXT_BYTES = 4096
"""Longest text of a message, UTF-8."""
MAX_ENTRIES = 1024
"""Most entries of a list in a message."""
MAX_WIDGETS = 64
"""Most widgets of a panel."""

Tone = Literal["good", "neutral", "warning", "bad"]
"""How a badge is meant."""
FaceName = Literal["happy", "sad", "surprised", "disgusted", "angry", "fearful", "neutral"]
"""The facial expressions of the paper."""


@dataclass(frozen=True)
class Text:
    """A labeled line of text."""

    widget: ClassVar[str] = "text"
    label: str
    text: str


@dataclass(frozen=True)
class Badge:
    """A state, set off from the rest."""

    widget: ClassVar[str] = "badge"
    label: str
    text: str
    tone: Tone = "neutral"


@dataclass(frozen=True)
class Bar:
    """A quantity within bounds."""

    widget: ClassVar[str] = "bar"
    label: str
    value: float
    min: float = 0.0
    max: float = 1.0


@dataclass(frozen=True)
class Face:
    """A facial expression, and how strong it is, 0 to 1."""

    widget: ClassVar[str] = "face"
    face: FaceName
    intensity: float


@dataclass(frozen=True)
class Sparkline:
    """A small curve of recent values, oldest first."""

    widget: ClassVar[str] = "sparkline"
    label: str
    values: Sequence[float]


@dataclass(frozen=True)
class Table:
    """Rows of text."""

    widget: ClassVar[str] = "table"
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Svg:
    """A picture; shown as an image, so that nothing in it runs. ``label`` says what it shows."""

    widget: ClassVar[str] = "svg"
    label: str
    svg: str


@dataclass(frozen=True)
class Button:
    """Sends the robot a command."""

    widget: ClassVar[str] = "button"
    label: str
    command: str


Widget = Union[Text, Badge, Bar, Face, Sparkline, Table, Svg, Button]


@dataclass(frozen=True)
class Panel:
    """Widgets from top to bottom."""

    widgets: Sequence[Widget] = field(default_factory=tuple)


def to_json(panel: Panel) -> str:
    """A panel as JSON, within the limits of a message: what cannot be shown is left out or cut."""
    shown = []
    for widget in panel.widgets[:MAX_WIDGETS]:
        fields = {name: _showable(value, name) for name, value in asdict(widget).items()}
        shown.append({"widget": widget.widget, **fields})
    return json.dumps({"widgets": shown})


def _showable(value: object, name: str) -> object:
    if isinstance(value, str):
        # The size of a picture is bounded by that of a message.
        return value if name == "svg" else value.encode(errors="replace")[:MAX_TEXT_BYTES].decode(errors="ignore")
    if isinstance(value, float) and not math.isfinite(value):
        return 0.0
    if isinstance(value, (list, tuple)):
        return [_showable(one, name) for one in value[:MAX_ENTRIES]]
    return value
