"""Reads a recording with the package `mcap` and prints what it has as JSON: read.py FILE."""

import json
import sys
from collections import Counter

from mcap.reader import make_reader


def read(path: str) -> dict:
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        channels = {
            channel.topic: {
                "encoding": channel.message_encoding,
                "schema": summary.schemas[channel.schema_id].name,
                "schema_encoding": summary.schemas[channel.schema_id].encoding,
            }
            for channel in summary.channels.values()
        }

        counts: Counter[str] = Counter()
        ticks = []
        for _, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            if channel.message_encoding == "json":
                json.loads(message.data)
            if channel.topic == "/frame":
                assert json.loads(message.data)["tick"] == message.sequence
                ticks.append([message.sequence, message.log_time, message.publish_time])

        attachments = {one.name: one.data.decode() for one in reader.iter_attachments()}
        metadata = {one.name: one.metadata for one in reader.iter_metadata()}

    return {
        "channels": channels,
        "counts": counts,
        "ticks": ticks,
        "attachments": attachments,
        "metadata": metadata,
    }


if __name__ == "__main__":
    json.dump(read(sys.argv[1]), sys.stdout)
