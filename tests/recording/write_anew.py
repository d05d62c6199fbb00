"""Writes a recording anew, message by message, with chunks that do not end with a tick."""

import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

path = sys.argv[1]
with open(path, "rb") as file:
    reader = make_reader(file)
    header = reader.get_header()
    messages = list(reader.iter_messages())
    attachments = list(reader.iter_attachments())
    metadata = list(reader.iter_metadata())

with open(path, "wb") as file:
    writer = Writer(file, chunk_size=50_000, compression=CompressionType.ZSTD)
    writer.start(header.profile, header.library)
    for attachment in attachments:
        writer.add_attachment(
            attachment.create_time, attachment.log_time, attachment.name, attachment.media_type, attachment.data
        )
    for record in metadata:
        writer.add_metadata(record.name, record.metadata)
    channels = {}
    for schema, channel, message in messages:
        if channel.id not in channels:
            schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
        writer.add_message(
            channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
        )
    writer.finish()
