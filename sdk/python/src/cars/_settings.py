"""Changes of a scenario, as the command line has them after ``--set``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Optional


def changes(settings: Optional[Mapping[str, Any]]) -> list[str]:
    """The changes as texts."""
    return [f"{path}={value if isinstance(value, str) else _toml(value)}" for path, value in (settings or {}).items()]


def _toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(name))} = {_toml(one)}" for name, one in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, int):
        return str(int(value))
    return repr(float(value))


def time(value: Any) -> Optional[str]:
    """A time: seconds, or a text with its unit."""
    return value if value is None or isinstance(value, str) else f"{float(value)!r} s"
