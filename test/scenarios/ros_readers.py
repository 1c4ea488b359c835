"""What the Python packages rosbags and mcap read in a recording of ROS, as JSON. Run by an interpreter that has both:

    ros_readers.py rosbags|mcap FILE
"""
import json
import pathlib
import sys

from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def numbers(pose):
    """x y z qx qy qz qw"""
    place, turn = (pose.position, pose.orientation) if hasattr(pose, "position") else (pose.translation, pose.rotation)
    return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]


def content(kind, message):
    if kind == "nav_msgs/msg/OccupancyGrid":
        info = message.info
        return {"frame": message.header.frame_id, "width": info.width, "height": info.height, "resolution": info.resolution, "origin": numbers(info.origin),
                "cells": [int(cell) for cell in message.data]}
    if kind == "nav_msgs/msg/Path":
        return {"frame": message.header.frame_id, "poses": [[seconds(pose.header.stamp), *numbers(pose.pose)] for pose in message.poses]}
    if kind == "tf2_msgs/msg/TFMessage":
        return [{"stamp": seconds(one.header.stamp), "parent": one.header.frame_id, "child": one.child_frame_id, "pose": numbers(one.transform)}
                for one in message.transforms]
    if kind == "sensor_msgs/msg/PointCloud2":
        return {"frame": message.header.frame_id, "fields": [[field.name, field.offset, field.datatype] for field in message.fields], "width": message.width,
                "height": message.height, "point_step": message.point_step, "is_dense": bool(message.is_dense), "data": bytes(message.data).hex()}
    raise ValueError(f"a message of {kind}")


class Found:
    def __init__(self):
        self.topics = {}

    def topic(self, name, kind):
        return self.topics.setdefault(name, {"type": kind, "messages": []})

    def add(self, name, kind, received_ns, message):
        self.topic(name, kind)["messages"].append([received_ns, content(kind, message)])


def read_bag(path):
    from rosbags.rosbag1 import Reader
    store, found = get_typestore(Stores.EMPTY), Found()
    with Reader(path) as bag:
        for connection in bag.connections:
            store.register({name: fields for name, fields in get_types_from_msg(connection.msgdef.data, connection.msgtype).items() if name not in store.types})
            found.topic(connection.topic, connection.msgtype).update(md5=connection.digest, latched=bool(connection.ext.latching),
                                                                     md5_of_definition=store.generate_msgdef(connection.msgtype)[1])
        for connection, received, data in bag.messages():
            found.add(connection.topic, connection.msgtype, received, store.deserialize_ros1(data, connection.msgtype))
    return found.topics


def read_mcap_by_rosbags(path):
    from rosbags.rosbag2.storage_mcap import McapReader
    store, found = get_typestore(Stores.EMPTY), Found()
    bag = McapReader(pathlib.Path(path))
    bag.open()
    for connection in bag.connections:
        store.register({name: fields for name, fields in get_types_from_msg(connection.msgdef.data, connection.msgtype).items() if name not in store.types})
        found.topic(connection.topic, connection.msgtype).update(latched=any(quality.durability.name == "TRANSIENT_LOCAL"
                                                                             for quality in connection.ext.offered_qos_profiles), count=connection.msgcount)
    for connection, received, data in bag.messages(bag.connections):
        found.add(connection.topic, connection.msgtype, received, store.deserialize_cdr(data, connection.msgtype))
    bag.close()
    return found.topics


def read_mcap(path):
    from mcap.reader import make_reader
    from mcap.stream_reader import StreamReader
    store, found = get_typestore(Stores.EMPTY), Found()
    with open(path, "rb") as file:
        for _ in StreamReader(file, validate_crcs=True).records:   # as it stands in the file, each checksum
            pass
        file.seek(0)
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2", reader.get_header()
        assert reader.get_summary().chunk_indexes
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            store.register({name: fields for name, fields in get_types_from_msg(schema.data.decode(), schema.name).items() if name not in store.types})
            found.add(channel.topic, schema.name, message.log_time, store.deserialize_cdr(message.data, schema.name))
    return found.topics


if __name__ == "__main__":
    by, path = sys.argv[1:]
    print(json.dumps(read_mcap(path) if by == "mcap" else read_bag(pathlib.Path(path)) if path.endswith(".bag") else read_mcap_by_rosbags(path)))
