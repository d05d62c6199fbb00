"""Changes of a scenario, as the command line has them after ``--set``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Optional

from . import _arguments

_MAPPING = "a mapping from paths to values, such as {'guests.count': 50}"


def changes(settings: Optional[Mapping[str, Any]], name: str = "set") -> list[str]:
    """The changes as texts. ``name`` is that of the argument, for errors."""
    texts = []
    for path, value in _arguments.mapping(name, settings, _MAPPING).items():
        texts.append(f"{path}={value if isinstance(value, str) else _toml(value, f'{name}[{path!r}]')}")
    return texts


def _toml(value: Any, name: str) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, Mapping):
        given = _arguments.mapping(name, value, "a table with texts as keys")
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(one, f'{name}[{key!r}]')}" for key, one in given.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(one, f"{name}[{index}]") for index, one in enumerate(value)) + "]"
    if hasattr(value, "__index__"):
        return str(value.__index__())
    return repr(_arguments.number(name, value, "a number, a text, True or False, a list or a mapping"))
