"""Reads an exported bag with mcap-ros2-support and with rosbags; compares bytes and hashes of types with those of rosbags, and prints
what the topics have."""

import json
import pathlib
import sys

from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

path = pathlib.Path(sys.argv[1])
kilted = get_typestore(Stores.ROS2_KILTED)

with path.open("rb") as stream:
    reader = make_reader(stream)
    profile = reader.get_header().profile
    schemas = list(reader.get_summary().schemas.values())
    for schema, channel, message in reader.iter_messages():
        again = kilted.serialize_cdr(kilted.deserialize_cdr(message.data, schema.name), schema.name)
        assert bytes(again) == message.data, (channel.topic, message.log_time)

hashes = {}
for schema in schemas:
    alone = get_typestore(Stores.EMPTY)
    alone.register(get_types_from_msg(schema.data.decode(), schema.name))
    hashes[schema.name] = alone.hash_rihs01(schema.name)
    assert hashes[schema.name] == kilted.hash_rihs01(schema.name), schema.name

with AnyReader([path]) as bag:
    counts = {connection.topic: connection.msgcount for connection in bag.connections}


def stamp_s(stamp):
    return stamp.sec + stamp.nanosec / 1e9


topics = {topic: [] for topic in counts}
for message in read_ros2_messages(str(path)):
    said, topic = message.ros_msg, message.channel.topic
    if topic == "/clock":
        row = stamp_s(said.clock)
        assert message.log_time_ns == round(row * 1e9)
    elif topic == "/tf":
        row = [[t.header.frame_id, t.child_frame_id, t.transform.translation.x, t.transform.translation.y] for t in said.transforms]
    elif topic == "/guests":
        row = [[pose.position.x, pose.position.y] for pose in said.poses]
    elif topic.endswith("/odom"):
        place, velocity = said.pose.pose, said.twist.twist
        turn = [place.orientation.z, place.orientation.w]
        row = [stamp_s(said.header.stamp), place.position.x, place.position.y, *turn, velocity.linear.x, velocity.linear.y, velocity.angular.z]
    else:
        row = said.data
    topics[topic].append(row)

assert counts == {topic: len(rows) for topic, rows in topics.items()}
print(json.dumps({"profile": profile, "hashes": hashes, "topics": topics}))
