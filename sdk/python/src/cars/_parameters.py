"""A robot's parameters as the robot's own type: a misspelled name would silently run another experiment."""

from __future__ import annotations

import dataclasses
import enum
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from ._errors import BadParameters

P = TypeVar("P")


def parameters(robot: str, kind: type[P], given: Mapping[str, Any]) -> P:
    """The parameters of a robot as an instance of the dataclass ``kind``.

    :raises BadParameters: which parameter is wrong, missing or unknown.
    """
    try:
        return build(kind, given)
    except ValueError as error:
        raise BadParameters(robot, str(error)) from None


def build(kind: type[P], values: Mapping[str, Any], path: str = "") -> P:
    """An instance of the dataclass ``kind``; what is left out has its default.

    Numbers, flags, texts, enumerations, literals, tuples of these and further dataclasses may be its fields.

    :raises ValueError: which parameter is unknown, missing or of the wrong kind.
    """
    if not dataclasses.is_dataclass(kind):
        raise TypeError(f"{kind.__name__} is not a dataclass")
    kinds = typing.get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    given = {}
    for name, value in values.items():
        if name not in fields:
            raise ValueError(f"unknown parameter {path}{name}; known are {', '.join(fields)}")
        given[name] = _convert(kinds[name], value, path + name)
    for name, field in fields.items():
        has_default = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        if name not in given and not has_default:
            raise ValueError(f"parameter {path}{name} is missing")
    return kind(**given)


def _convert(kind: Any, value: Any, path: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if type(None) in arguments:
        wanted = next(one for one in arguments if one is not type(None))
        return None if value is None else _convert(wanted, value, path)
    if isinstance(kind, type) and dataclasses.is_dataclass(kind) and isinstance(value, dict):
        return build(kind, value, f"{path}.")
    if origin is tuple and isinstance(value, list):
        kinds = arguments[:1] * len(value) if arguments[1:] == (...,) else arguments
        if len(kinds) == len(value):
            return tuple(_convert(one, part, path) for one, part in zip(kinds, value))
    if origin is typing.Literal:
        return _choose({one: one for one in arguments}, value, path)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return _choose({member.value: member for member in kind}, value, path)
    return _plain(kind, value, path)


def _choose(known: Mapping[Any, Any], value: Any, path: str) -> Any:
    if not isinstance(value, (str, int, float)) or value not in known:
        raise ValueError(f"{path} must be one of {', '.join(map(str, known))}, not {value!r}")
    return known[value]


def _plain(kind: Any, value: Any, path: str) -> Any:
    if kind is Any or type(value) is kind:
        return value
    # 7 and 7.0 are the same number.
    if kind is float and type(value) is int:
        return float(value)
    if kind is int and type(value) is float and value.is_integer():
        return int(value)
    raise ValueError(f"{path} must be {_words(kind)}, not {value!r}")


def _words(kind: Any) -> str:
    if typing.get_origin(kind) is tuple:
        return "a list of " + " and ".join(_words(one) for one in typing.get_args(kind) if one is not ...)
    words = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
    return words.get(kind, "a table")
