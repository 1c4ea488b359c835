"""Writes messages of ROS 1 into bags by the libraries of others:  write_bag.py MESSAGES KIND:COPIES:OUT...

KIND: ros1, ros1-bz2, ros1-lz4, mcap, mcap-zstd, mcap-message, db3, db3-file, db3-message (by PyPI's rosbags), mcap-lz4 (by PyPI's mcap): run by the interpreter of ros_packages.py;
rosbag, rosbag-bz2, rosbag-lz4 (by ROS 1's own library): run by an interpreter that has it. OUT is a file, of db3 a folder of rosbag2.
MESSAGES: pickled, (topic, type, nanoseconds, bytes), by time. They are deserialized and serialized again by the library. COPIES: how often, one after the other; transforms once.
"""
import functools
import pathlib
import pickle
import shutil
import struct
import sys

STAMP = 4   # where the header's stamp begins: behind seq in ROS 1, behind the encapsulation in CDR
TRANSFORMS = "tf2_msgs/TFMessage"


def copies_of(messages, copies):
    """(index of the topic, nanoseconds, bytes), of as many drives after each other."""
    topics = topics_of(messages)
    index = {topic: i for i, (topic, _) in enumerate(topics)}
    times = [at for _, kind, at, _ in messages if kind != TRANSFORMS]
    period = max(times) - min(times) + 200_000_000 if times else 0
    for copy in range(copies):
        for topic, kind, at, data in messages:
            if copy > 0:
                if kind == TRANSFORMS:
                    continue
                at += copy * period
                data = bytearray(data)
                struct.pack_into("<II", data, STAMP, at // 1_000_000_000, at % 1_000_000_000)
            yield index[topic], at, data


def topics_of(messages):
    return list(dict.fromkeys((topic, kind) for topic, kind, _, _ in messages))


def normal(kind):
    package, name = kind.split("/")
    return f"{package}/msg/{name}"


@functools.lru_cache
def types():
    """Of ROS 1 and of ROS 2, as rosbags has them."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    ros1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", normal(TRANSFORMS)))
    return ros1, ros2


class Messages:
    """Of a file, as rosbags' own types serialize them."""

    def __init__(self, path):
        self.given = pickle.loads(path.read_bytes())

    @functools.cached_property
    def ros1(self):
        store = types()[0]
        return [(topic, kind, at, bytes(store.serialize_ros1(store.deserialize_ros1(data, normal(kind)), normal(kind)))) for topic, kind, at, data in self.given]

    @functools.cached_property
    def cdr(self):
        store = types()[1]
        return [(topic, kind, at, bytes(store.serialize_cdr(store.deserialize_cdr(store.ros1_to_cdr(data, normal(kind)), normal(kind)), normal(kind)))) for topic, kind, at, data in self.given]


def write_all(writer, messages, copies, store):
    connections = [writer.add_connection(topic, normal(kind), typestore=store) for topic, kind in topics_of(messages)]
    for topic, at, data in copies_of(messages, copies):
        writer.write(connections[topic], at, data)


def write_ros1(kind, messages, out, copies):
    from rosbags.rosbag1 import Writer
    writer = Writer(out)
    if kind != "ros1":
        writer.set_compression(Writer.CompressionFormat[kind.split("-")[1].upper()])
    with writer:
        write_all(writer, messages.ros1, copies, types()[0])


def write_ros2(kind, messages, out, copies):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    is_mcap = kind.startswith("mcap")
    folder = out.with_suffix(".folder") if is_mcap else out
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP if is_mcap else StoragePlugin.SQLITE3)
    if "-" in kind:
        writer.set_compression(CompressionMode[{"zstd": "STORAGE"}.get(kind.split("-")[1], kind.split("-")[1].upper())], CompressionFormat.ZSTD)
    with writer:
        write_all(writer, messages.cdr, copies, types()[1])
    if is_mcap:
        next(folder.glob("*.mcap")).replace(out)
        shutil.rmtree(folder)


def write_mcap_lz4(messages, out, copies):
    from mcap.writer import CompressionType, Writer
    store = types()[1]
    with out.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("ros2")
        channels = []
        for topic, kind in topics_of(messages.cdr):
            schema = writer.register_schema(normal(kind), "ros2msg", store.generate_msgdef(normal(kind), ros_version=2)[0].encode())
            channels.append(writer.register_channel(topic, "cdr", schema))
        for topic, at, data in copies_of(messages.cdr, copies):
            writer.add_message(channels[topic], at, bytes(data), at)
        writer.finish()


def write_by_rosbag(kind, messages, out, copies):
    import genpy
    import rosbag
    import roslib.message
    topics = [(topic, roslib.message.get_message_class(kind)) for topic, kind in topics_of(messages.given)]
    with rosbag.Bag(str(out), "w", compression=kind.split("-")[1] if "-" in kind else "none") as bag:
        for index, at, data in copies_of(messages.given, copies):
            topic, message = topics[index]
            bag.write(topic, message().deserialize(bytes(data)), genpy.Time(at // 1_000_000_000, at % 1_000_000_000))


def main():
    messages = Messages(pathlib.Path(sys.argv[1]))
    for wanted in sys.argv[2:]:
        kind, copies, out = wanted.split(":", 2)
        if kind == "mcap-lz4":
            write_mcap_lz4(messages, pathlib.Path(out), int(copies))
        else:
            write = write_by_rosbag if kind.startswith("rosbag") else write_ros1 if kind.startswith("ros1") else write_ros2
            write(kind, messages, pathlib.Path(out), int(copies))


if __name__ == "__main__":
    main()
