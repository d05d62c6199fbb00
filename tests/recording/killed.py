"""Reads the recording of a run that was killed with the package `mcap` and prints the number of its ticks: killed.py FILE."""

import sys

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

with open(sys.argv[1], "rb") as file:
    try:
        next(iter(make_reader(file).iter_messages()), None)
        sys.exit("make_reader did not fail")
    except McapError:
        # Which one depends on the bytes at the end, where it expects the index.
        pass

topics = {}
ticks = 0
with open(sys.argv[1], "rb") as file:
    try:
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            if isinstance(record, Message) and topics[record.channel_id] == "/frame":
                ticks += 1
        sys.exit("the file has an end")
    except EndOfFile:
        print(ticks)
