"""Tables as frames of pandas or polars, of which neither is needed before a frame is asked for."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, Optional

from ._errors import Error

Frame = Any
"""A frame: ``pandas.DataFrame`` or ``polars.DataFrame``."""

_NEEDS = {"pandas": ("pandas", "pyarrow"), "polars": ("polars",)}

# The columns that are not of texts, as docs/exports.md and docs/experiments.md have them.
_INTEGERS = "epoch tick generation seq until_tick seed protocol commands cells unit yoked_to_seed".split()
_REALS = "time_s x_m y_m tick_s speed_mps direction_rad proposal_x_m proposal_y_m heading_rad change number".split()
_FLAGS = "cuts_commands cuts_queries begins by_hand blocked missed".split()
_TYPES = dict.fromkeys(_INTEGERS, "int64") | dict.fromkeys(_REALS, "double") | dict.fromkeys(_FLAGS, "bool")

_REAL = re.compile(r"-?(\d+\.\d+|\d+(\.\d+)?e-?\d+|inf)|NaN")
"""A real number in a table."""


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
    """A table of a run, to the last bit: an empty text is no null."""
    with open(path, encoding="utf-8", newline="") as file:
        columns = next(csv.reader(file))
    return _read(path, kind, {name: _TYPES.get(name, "string") for name in columns})


def read_runs(path: Path, kind: Optional[str] = None) -> Frame:
    """The table of an experiment. Its factors and measures are columns of reals if they have nothing else."""
    with open(path, encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    types = {}
    for name, *values in zip(head, *rows):
        is_text = name in ("condition", "arm", "failed", "digest") or name.endswith("_state")
        is_real = not is_text and all(not value or _REAL.fullmatch(value) for value in values)
        whole = name in ("unit", "seed", "yoked_to_seed")
        types[name] = "int64" if whole else "double" if is_real else "string"
    return _read(path, kind, types)


def _read(path: Path, kind: Optional[str], types: Mapping[str, str]) -> Frame:
    if chosen(kind) == "pandas":
        import pandas
        import pyarrow.csv

        lines = pyarrow.csv.ParseOptions(newlines_in_values=True)
        cells = pyarrow.csv.ConvertOptions(
            column_types=types,
            null_values=[""],
            strings_can_be_null=True,
            quoted_strings_can_be_null=False,
        )
        table = pyarrow.csv.read_csv(path, parse_options=lines, convert_options=cells)
        # Whole numbers and flags stay what they are where a value is missing.
        nullable = {
            pyarrow.int64(): pandas.Int64Dtype(),
            pyarrow.float64(): pandas.Float64Dtype(),
            pyarrow.bool_(): pandas.BooleanDtype(),
            pyarrow.string(): pandas.StringDtype(),
        }
        return table.to_pandas(types_mapper=nullable.get)
    import polars

    schema = {"int64": polars.Int64, "double": polars.Float64, "bool": polars.Boolean, "string": polars.String}
    return polars.read_csv(path, schema={name: schema[of] for name, of in types.items()})


def of_rows(rows: Sequence[Mapping[str, Any]], kind: Optional[str] = None) -> Frame:
    """The table of these rows; what is in a mapping of a row gets columns with names such as ``interval.low``."""
    flat = [_flat(row) for row in rows]
    if chosen(kind) == "pandas":
        import pandas

        return pandas.DataFrame(flat)
    import polars

    return polars.DataFrame(flat, infer_schema_length=None)


def of_columns(columns: Mapping[str, Sequence[Any]], kind: Optional[str] = None) -> Frame:
    """The table of these columns, which it has without a row, too."""
    if chosen(kind) == "pandas":
        import pandas

        return pandas.DataFrame(columns)
    import polars

    return polars.DataFrame(columns)


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
