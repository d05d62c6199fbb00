"""Tables as frames of pandas or polars, of which neither is needed before a frame is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, Optional

from ._errors import Error

Frame = Any
"""A frame: ``pandas.DataFrame`` or ``polars.DataFrame``."""

_NEEDS = {"pandas": ("pandas", "pyarrow"), "polars": ("polars",)}


class Frames(NamedTuple):
    """The tables of a run, as ``cars export`` has them."""

    events: Frame
    """A row for each event."""
    states: Frame
    """A row for each robot in each tick."""
    variables: Frame
    """A row for each state variable of each robot in each tick."""


def chosen(kind: Optional[str]) -> str:
    """The library of frames: as asked for, or pandas where it is installed, else polars.

    :raises Error: if it is not installed.
    """
    if kind is not None and kind not in _NEEDS:
        raise ValueError(f"a frame is of pandas or polars, not of {kind!r}")
    for name in _NEEDS if kind is None else (kind,):
        if all(find_spec(module) for module in _NEEDS[name]):
            return name
    wanted = "pandas with pyarrow, or polars" if kind is None else " with ".join(_NEEDS[kind])
    raise Error(f"frames need {wanted}: pip install 'cars-simulator[{kind or 'pandas'}]'")


def read(path: Path, kind: Optional[str] = None) -> Frame:
    """The table in a Parquet file."""
    if chosen(kind) == "pandas":
        import pandas

        # Whole numbers and flags stay what they are where a value is missing.
        return pandas.read_parquet(path, dtype_backend="numpy_nullable")
    import polars

    return polars.read_parquet(path)


def of_rows(rows: Sequence[Mapping[str, Any]], kind: Optional[str] = None) -> Frame:
    """The table of these rows; what is in a mapping of a row gets columns with names such as ``interval.low``."""
    flat = [_flat(row) for row in rows]
    if chosen(kind) == "pandas":
        import pandas

        return pandas.DataFrame(flat)
    import polars

    return polars.DataFrame(flat, infer_schema_length=None)


def with_value(frame: Frame, column: str) -> Frame:
    """The rows of a frame that have a value in a column, and of their columns those that have any."""
    if hasattr(frame, "dropna"):
        return frame[frame[column].notna()].dropna(axis="columns", how="all")
    rows = frame.drop_nulls(column)
    return rows[[name for name in rows.columns if rows[name].null_count() < len(rows)]]


def _flat(row: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    cells: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            cells.update(_flat(value, f"{path}{name}."))
        else:
            cells[path + name] = value
    return cells
