"""Checks what general viewers draw of a recording with Foxglove's own package; prints the last message of each topic.

The schemas are those of the package, type by type and field by field, and it encodes each message to the same bytes.
"""

import importlib
import json
import struct
import sys

from google.protobuf import descriptor_pb2, json_format
from mcap.reader import make_reader


def module(schema):
    return importlib.import_module(f"foxglove_schemas_protobuf.{schema}_pb2")


def types(files):
    """The fields and values of all types, by their names."""
    found = {}

    def add_message(prefix, message):
        name = f"{prefix}.{message.name}"
        fields = [(field.name, field.number, field.type, field.label, field.type_name) for field in message.field]
        found[name] = sorted(fields)
        for enum in message.enum_type:
            add_enum(name, enum)
        for inner in message.nested_type:
            add_message(name, inner)

    def add_enum(prefix, enum):
        found[f"{prefix}.{enum.name}"] = sorted((value.name, value.number) for value in enum.value)

    for file in files:
        for message in file.message_type:
            add_message(file.package, message)
        for enum in file.enum_type:
            add_enum(file.package, enum)
    return found


def files_of(descriptor, found=None):
    """The files of a type and of all that it depends on."""
    found = {} if found is None else found
    if descriptor.name not in found:
        file = descriptor_pb2.FileDescriptorProto()
        descriptor.CopyToProto(file)
        found[descriptor.name] = file
        for dependency in descriptor.dependencies:
            files_of(dependency, found)
    return found


schemas = set()
last = {}
with open(sys.argv[1], "rb") as file:
    for schema, channel, message in make_reader(file).iter_messages():
        if not channel.topic.startswith("/view/"):
            continue
        name = schema.name.removeprefix("foxglove.")
        if name not in schemas:
            recorded = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            assert types(recorded.file) == types(files_of(module(name).DESCRIPTOR).values()), name
            schemas.add(name)

        decoded = getattr(module(name), name).FromString(message.data)
        assert decoded.SerializeToString(deterministic=True) == message.data, (channel.topic, message.sequence)
        last[channel.topic] = json_format.MessageToDict(decoded)
        if name == "PointCloud":
            last[channel.topic]["points"] = list(struct.iter_unpack("<fff", decoded.data))

json.dump({"schemas": sorted(schemas), "last": last}, sys.stdout)
