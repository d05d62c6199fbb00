"""Whose robots played a unit: a digest of the program of a class."""

from __future__ import annotations

import functools
import hashlib
import inspect
import marshal
import sys
from collections.abc import Callable, Mapping
from types import CodeType, ModuleType
from typing import Any, Optional


def digests(makers: Mapping[str, Callable[[], Any]]) -> dict[str, str]:
    """A digest of the program of each maker: its qualified name, and the text of its module and of those of its base classes.

    What the module imports, files that it reads and variables that it closes over are not noticed.
    """
    return {of: _digest(make) for of, make in makers.items()}


def _digest(make: Any) -> str:
    digest = hashlib.sha256()
    for part in _parts(make):
        text = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        digest.update(len(text).to_bytes(8, "little"))
        digest.update(text)
    return digest.hexdigest()[:32]


def _parts(make: Any) -> list[Any]:
    """What makes up the program of a class, a function, or an object that is called."""
    if isinstance(make, functools.partial):
        # A class that is an argument is part of the program, as that of a node is.
        of_classes = [part for given in make.args if inspect.isclass(given) for part in _parts(given)]
        return [*_parts(make.func), *of_classes, repr(make.args), repr(sorted(make.keywords.items()))]
    if inspect.isclass(make):
        parts: list[Any] = []
        for one in make.__mro__:
            if not _is_given(one.__module__):
                parts += [f"{one.__module__}.{one.__qualname__}", _program(one)]
        return parts
    if inspect.isroutine(make):
        function = inspect.unwrap(getattr(make, "__func__", make))
        return [f"{function.__module__}.{function.__qualname__}", _program(function)]
    return _parts(type(make))


def _is_given(module: str) -> bool:
    """Whether a module comes with Python or with this package: the versions of these are known elsewhere."""
    top = module.partition(".")[0]
    return top in ("builtins", "abc", "typing", "cars")


def _program(of: Any) -> Any:
    """The text of its module; where there is none, as in a notebook, its own; where there is none either, its code."""
    module = sys.modules.get(of.__module__)
    for source in (_file_of(module), of):
        if source is not None:
            try:
                return inspect.getsource(source)
            except (OSError, TypeError):
                pass
    return b"".join(_codes(of))


def _file_of(module: Optional[ModuleType]) -> Optional[ModuleType]:
    return module if getattr(module, "__file__", None) else None


def _codes(of: Any) -> list[bytes]:
    """The code of a function, or of all functions of a class."""
    if inspect.isclass(of):
        return [code for _, value in sorted(vars(of).items()) for code in _codes(value)]
    function = getattr(of, "__func__", getattr(of, "fget", of))
    code = getattr(function, "__code__", None)
    if isinstance(code, CodeType):
        # Of the second version: later ones depend on who else refers to the code.
        return [marshal.dumps(code, 2)]
    return [] if callable(of) else [repr(of).encode()] if isinstance(of, (bool, int, float, str)) else []
