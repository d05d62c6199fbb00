"""Compares exported tables with the record of the run: tables.py RUN TABLES PAGE [EPOCH...].

RUN is the folder of the run, TABLES that of the tables, PAGE the page that states their columns. Each table is read by pandas,
polars and DuckDB. Every value must be that of events.jsonl or run.mcap, to the last bit.
"""

import json
import re
import struct
import sys
from pathlib import Path

import duckdb
import pandas
import polars
from mcap.reader import make_reader

KINDS = {
    "integer": ("Int64", polars.Int64, "BIGINT"),
    "real": ("Float64", polars.Float64, "DOUBLE"),
    "flag": ("boolean", polars.Boolean, "BOOLEAN"),
    "text": ("string", polars.String, "VARCHAR"),
}
# Fields of events.jsonl that have another name in the table: by kind of event, or of all others.
RENAMED = {
    "emotion": {"from": "state_before", "to": "state_after"},
    "behavior": {"from": "state_before", "to": "state_after"},
    "fault": {"kind": "fault"},
    "link_cut": {"commands": "cuts_commands", "queries": "cuts_queries", "from": "from_robot", "to": "to_robot"},
}
MESSAGE = {"from": "from_robot", "to": "to_robot", "until": "until_tick"}


def columns_of(page: str, table: str) -> dict[str, str]:
    """The columns that the page states, with their kinds."""
    section = page.split(f"### {table}\n")[1].split("\n##")[0]
    columns = dict(re.findall(r"^\| `(\w+)` \| (\w+) \|", section, re.MULTILINE))
    return {"epoch": "integer", "tick": "integer", "time_s": "real"} | columns


def files_of(run: Path, name: str) -> dict[int, Path]:
    """The files of each epoch that are called `name` in the last one."""
    stem, ending = name.split(".")
    found = {int(path.stem.split("epoch")[1]): path for path in run.glob(f"{stem}-epoch*.{ending}")}
    if (run / name).exists():
        last = len(list(run.glob("events-epoch*.jsonl"))) + 1
        found[last] = run / name
    return dict(sorted(found.items()))


def cells_of(event: dict) -> dict:
    """The cells of an event of events.jsonl."""
    names = RENAMED.get(event["event"], MESSAGE)
    # A record leaves out what is false.
    cells = {"by_hand": False} if event["event"] == "changed" else {}
    for field, value in event.items():
        if field == "seal":
            continue
        if field == "at":
            cells |= {"x_m": value["x"], "y_m": value["y"]}
        elif field == "by":
            robot = value["robot"] if isinstance(value, dict) else None
            cells |= {"blocked_by": "robot" if robot else value, "blocked_by_robot": robot}
        else:
            cells[names.get(field, field)] = value
    return cells


def expected_events(run: Path, epochs: list[int]) -> list[dict]:
    rows = []
    for epoch, path in files_of(run, "events.jsonl").items():
        if epoch not in epochs:
            continue
        # What follows the last line break, or the last complete tick, is not complete.
        lines = path.read_text().split("\n")[:-1]
        events = [json.loads(line) for line in lines]
        while events[-1]["event"] not in ("tick", "end"):
            events.pop()
        tick_s = events[0]["tick_s"]
        for event in events:
            rows.append({"epoch": epoch, "time_s": event["tick"] * tick_s} | cells_of(event))
    return rows


def expected_states(run: Path, epochs: list[int]) -> tuple[list[dict], list[dict]]:
    states, variables = [], []
    for epoch, path in files_of(run, "run.mcap").items():
        if epoch not in epochs:
            continue
        frames, reports = [], {}
        with open(path, "rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                if channel.topic == "/frame":
                    frames.append(json.loads(message.data))
                elif channel.topic == "/header":
                    tick_s = json.loads(message.data)["tick_s"]
                elif channel.topic.endswith("/report"):
                    reports[channel.topic.split("/")[2], message.sequence] = json.loads(message.data)
        for frame in frames:
            when = {"epoch": epoch, "tick": frame["tick"], "time_s": frame["tick"] * tick_s}
            for robot in frame["robots"]:
                report = reports.get((robot["name"], frame["tick"]))
                states.append(when | state(robot, report))
                for name, value in (report or {}).get("state_variables", {}).items():
                    variables.append(when | {"robot": robot["name"], "variable": name} | variable(value))
    return states, variables


def state(robot: dict, report: dict | None) -> dict:
    cells = {
        "robot": robot["name"],
        "x_m": robot["location"]["x"],
        "y_m": robot["location"]["y"],
        "blocked": robot.get("blocked", False),
        "missed": "missed" in robot,
        "heading_rad": robot.get("heading_rad"),
    }
    if report is not None:
        cells |= {
            "generation": report["generation"],
            "speed_mps": report["speed_mps"],
            "direction_rad": report["direction_rad"],
            "emotion": report["emotion_state"],
            "behavior": report["behavior_state"],
            "commands": report.get("commands", 0),
            "proposal_x_m": report["proposal"]["x"],
            "proposal_y_m": report["proposal"]["y"],
        }
    return cells


def variable(value) -> dict:
    if isinstance(value, bool):
        return {"type": "flag", "value": str(value).lower(), "number": float(value)}
    if isinstance(value, str):
        return {"type": "text", "value": value, "number": None}
    return {"type": "number", "number": float(value)}


def read_pandas(path: Path, columns: dict[str, str]) -> list[dict]:
    dtypes = {name: KINDS[kind][0] for name, kind in columns.items()}
    # Since 3.1 it is the default.
    version = tuple(int(part) for part in pandas.__version__.split(".")[:2])
    exact = {"float_precision": "round_trip"} if version < (3, 1) else {}
    frame = pandas.read_csv(path, dtype=dtypes, keep_default_na=False, na_values=[""], **exact)
    assert {name: str(kind) for name, kind in frame.dtypes.items()} == dtypes, frame.dtypes
    return frame.astype(object).where(frame.notna(), None).to_dict("records")


def read_polars(path: Path, columns: dict[str, str]) -> list[dict]:
    schema = {name: KINDS[kind][1] for name, kind in columns.items()}
    frame = polars.read_csv(path, schema=schema)
    assert dict(frame.schema) == schema, frame.schema
    return frame.to_dicts()


def read_duckdb(path: Path, columns: dict[str, str]) -> list[dict]:
    types = {name: KINDS[kind][2] for name, kind in columns.items()}
    options = f"delim = ',', quote = '\"', escape = '\"', allow_quoted_nulls = false, columns = {types}"
    result = duckdb.sql(f"SELECT * FROM read_csv('{path}', header = true, {options})")
    assert dict(zip(result.columns, map(str, result.types))) == types, result.types
    return [dict(zip(result.columns, row)) for row in result.fetchall()]


def same(one, other, reader: str) -> bool:
    if reader.startswith("read_pandas"):
        # It does not tell a null from an empty text.
        one = None if one == "" else one
        other = None if other == "" else other
    if isinstance(one, float) and isinstance(other, float):
        return struct.pack("<d", one) == struct.pack("<d", other)
    return type(one) is type(other) and one == other


def compare(found: list[dict], expected: list[dict], columns: dict[str, str], what: str) -> None:
    assert len(found) == len(expected), f"{what}: {len(found)} rows, expected {len(expected)}"
    for number, (row, wanted) in enumerate(zip(found, expected)):
        assert list(row) == list(columns), f"{what}: columns {list(row)}"
        assert wanted.keys() <= row.keys(), f"{what}: no columns {wanted.keys() - row.keys()}"
        for name, value in row.items():
            # The digits of a number as text are those of Rust; the number itself is in another column.
            if name == "value" and wanted["type"] == "number":
                assert float(value) == wanted["number"], f"{what}, row {number}: {value}"
                continue
            value_wanted = wanted.get(name)
            if columns[name] == "real" and value_wanted is not None:
                value_wanted = float(value_wanted)
            assert same(value, value_wanted, what), (
                f"{what}, row {number}, {name}: {value!r}, expected {value_wanted!r}"
            )


def main() -> None:
    run, tables, page, *epochs = sys.argv[1:]
    run, tables, page = Path(run), Path(tables), Path(page).read_text()
    epochs = [int(epoch) for epoch in epochs] or list(files_of(run, "events.jsonl"))

    expected = {"events": expected_events(run, epochs)}
    if files_of(run, "run.mcap"):
        expected["states"], expected["variables"] = expected_states(run, epochs)
    for table, rows in expected.items():
        columns = columns_of(page, table)
        path = tables / f"{table}.csv"
        for read in (read_pandas, read_polars, read_duckdb):
            compare(read(path, columns), rows, columns, f"{read.__name__} {path.name}")
    names = {path.name for path in tables.iterdir()}
    assert names == {f"{table}.csv" for table in expected}, names
    found = {table: len(rows) for table, rows in expected.items()}
    found["kinds"] = sorted({row["event"] for row in expected["events"]})
    found["generations"] = sorted({row.get("generation") or 0 for row in expected.get("states", [])})
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
