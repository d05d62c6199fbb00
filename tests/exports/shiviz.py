"""Reads a log as ShiViz does and compares it with the record of the run: shiviz.py RUN LOG.

The rules are those of ShiViz: the first line is the regular expression of an event, the second that of the line before an
execution. The clock of a host counts its events from 1, and names only hosts that have events.
"""

import json
import re
import sys
from collections import defaultdict
from pathlib import Path


def pattern(line: str) -> re.Pattern:
    """A regular expression of JavaScript with named groups."""
    return re.compile(line.replace("(?<", "(?P<"), re.MULTILINE)


def check(execution: str, event: re.Pattern, record: list[dict]) -> None:
    rows = list(event.finditer(execution))
    assert len(rows) == len(execution.strip("\n").split("\n")), "a line is no event"

    clocks = {}
    counts = defaultdict(int)
    sent, received = defaultdict(list), []
    for row in rows:
        host, clock = row["host"], json.loads(row["clock"])
        counts[host] += 1
        assert clock[host] == counts[host], row[0]
        before = clocks.get(host, {})
        assert all(clock.get(other, 0) >= count for other, count in before.items()), row[0]
        grown = {other for other in clock if clock[other] != before.get(other, 0)} - {host}
        clocks[host] = clock

        if match := re.match(r"sends (\S+): (.*)", row["event"]):
            sent[host, match[1], match[2]].append(clock)
        if match := re.match(r"receives from (\S+): (.*)", row["event"]):
            candidates = sent[match[1], host, match[2]]
            assert any(dominates(clock, candidate) for candidate in candidates), row[0]
            received.append(row)
        else:
            # Only a command brings knowledge of another host.
            assert not grown, row[0]
    assert all(host in counts for clock in clocks.values() for host in clock)

    kinds = [line["event"] for line in record]
    assert len(received) == kinds.count("command_delivered")
    assert sum(map(len, sent.values())) == kinds.count("command_sent")
    print(json.dumps({"hosts": sorted(counts), "sent": sum(map(len, sent.values())), "received": len(received)}))


def dominates(one: dict, other: dict) -> bool:
    return all(one.get(host, 0) >= count for host, count in other.items())


def main() -> None:
    run, log = map(Path, sys.argv[1:])
    event, delimiter, rest = log.read_text().split("\n", 2)
    files = sorted(run.glob("events-epoch*.jsonl")) + [run / "events.jsonl"]
    before, *executions = pattern(delimiter).split(rest)
    names, executions = executions[::2], executions[1::2]
    assert before == "" and names == [str(number) for number in range(1, len(files) + 1)], names
    for execution, path in zip(executions, files):
        record = [json.loads(line) for line in path.read_text().split("\n") if line]
        check(execution, pattern(event), record)


if __name__ == "__main__":
    main()
