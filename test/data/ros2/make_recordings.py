#!/usr/bin/env python3
"""Makes the recordings beside it: pip install rosbags==0.11.9 mcap==1.6.0, then make_recordings.py.

Each holds six scans of /scan (sensor_msgs/LaserScan of five rays) at 100.0, 100.1 ... s and three texts of /note (std_msgs/String) at 100.05,
100.25 and 100.45 s; received 10 ms later.
"""
import pathlib
import shutil
import sqlite3

import numpy
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

HERE = pathlib.Path(__file__).resolve().parent
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
SCAN, NOTE = "sensor_msgs/msg/LaserScan", "std_msgs/msg/String"


def scan(store, number):
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=100, nanosec=number * 100_000_000)
    sequence = {"seq": number} if store is ROS1 else {}
    return types[SCAN](header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="laser", **sequence), angle_min=-1.0, angle_max=1.0,
                       angle_increment=0.5, time_increment=0.0, scan_time=0.1, range_min=0.05, range_max=30.0,
                       ranges=numpy.array([1.0, 2.0, 3.0, 4.0, 5.0 + number], dtype=numpy.float32), intensities=numpy.array([], dtype=numpy.float32))


def messages(store=ROS2):
    """(topic, type, received, bytes) in the order of receipt."""
    serialize = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
    all_of_them = [("/scan", SCAN, 100_010_000_000 + number * 100_000_000, bytes(serialize(scan(store, number), SCAN))) for number in range(6)]
    all_of_them += [("/note", NOTE, 100_060_000_000 + number * 200_000_000, bytes(serialize(store.types[NOTE](data=f"note {number}"), NOTE)))
                    for number in range(3)]
    return sorted(all_of_them, key=lambda message: message[2])


def rosbag2_folder(name, storage=StoragePlugin.SQLITE3, mode=None, version=9, what=None):
    folder = HERE / name
    shutil.rmtree(folder, ignore_errors=True)
    writer = Writer(folder, version=version, storage_plugin=storage)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=ROS2) for topic, kind in (("/scan", SCAN), ("/note", NOTE))}
        for topic, _, received, data in what or messages():
            writer.write(topics[topic], received, data)
    for database in folder.glob("*.db3"):
        shrink(sqlite3.connect(database))


def shrink(database):
    """Small pages: tests read these files hundreds of times."""
    database.execute("PRAGMA page_size=512")
    database.execute("VACUUM")
    database.close()


def split_folder():
    """Two parts, of which the first was made by an early ROS 2 (schema without quality of service)."""
    folder = HERE / "split"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    half = len(messages()) // 2
    for number, part in enumerate((messages()[:half], messages()[half:])):
        database = sqlite3.connect(folder / f"split_{number}.db3")
        quality = "" if number == 0 else ", offered_qos_profiles TEXT NOT NULL"
        database.execute(f"CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL{quality})")
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        ids = {"/scan": 1 + number, "/note": 2 - number}   # not the same in both parts
        for topic, kind in (("/scan", SCAN), ("/note", NOTE)):
            database.execute(f"INSERT INTO topics VALUES(?, ?, ?, 'cdr'{', ?' if number else ''})", (ids[topic], topic, kind) + (("",) if number else ()))
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", [(ids[topic], received, data) for topic, _, received, data in part])
        database.commit()
        shrink(database)
    (folder / "metadata.yaml").write_text("""rosbag2_bagfile_information:
  version: 4
  storage_identifier: sqlite3
  relative_file_paths: [split_0.db3, split_1.db3]
  duration: {nanoseconds: 500000000}
  starting_time: {nanoseconds_since_epoch: 100010000000}
  message_count: 9
  topics_with_message_count:
    - topic_metadata: {name: /scan, type: sensor_msgs/msg/LaserScan, serialization_format: cdr, offered_qos_profiles: ""}
      message_count: 6
    - topic_metadata: {name: /note, type: std_msgs/msg/String, serialization_format: cdr, offered_qos_profiles: ""}
      message_count: 3
  compression_format: ""
  compression_mode: ""
""")


def mcap(name, compression, what, chunk_size=400, extras=False, **options):
    """what: messages, and None where a chunk ends."""
    ros1 = options.pop("ros1", False)
    with open(HERE / name, "wb") as file:
        writer = McapWriter(file, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile="ros1" if ros1 else "ros2", library="make_recordings.py")
        channels = {}
        for topic, kind in (("/scan", SCAN), ("/note", NOTE)):
            schema = writer.register_schema(kind.replace("msg/", "") if ros1 else kind, "ros1msg" if ros1 else "ros2msg", b"")
            channels[topic] = writer.register_channel(topic, "ros1" if ros1 else "cdr", schema)
        if extras:
            channels["/status"] = writer.register_channel("/status", "json", writer.register_schema("status", "jsonschema", b"{}"))
            writer.add_attachment(100, 100, "notes.txt", "text/plain", b"an attachment")
            writer.add_metadata("robot", {"name": "alice"})
        for number, (topic, _, received, data) in enumerate(what):
            writer.add_message(channels[topic], received, data, received, number)
        if extras:
            writer.add_message(channels["/status"], 100_600_000_000, b"{}", 100_600_000_000)
        writer.finish()


def main():
    rosbag2_folder("plain")
    rosbag2_folder("as_mcap", StoragePlugin.MCAP)
    rosbag2_folder("file_zstd", mode=CompressionMode.FILE, version=8)
    rosbag2_folder("message_zstd", mode=CompressionMode.MESSAGE)
    rosbag2_folder("message_zstd_mcap", StoragePlugin.MCAP, CompressionMode.MESSAGE)
    split_folder()
    mcap("none.mcap", CompressionType.NONE, messages(), extras=True)
    mcap("lz4.mcap", CompressionType.LZ4, messages())
    mcap("zstd.mcap", CompressionType.ZSTD, messages())
    mcap("unchunked.mcap", CompressionType.NONE, messages(), use_chunking=False, enable_data_crcs=True, extras=True)
    mcap("ros1.mcap", CompressionType.LZ4, messages(ROS1), ros1=True)
    in_order = messages()
    mcap("chunks_out_of_order.mcap", CompressionType.ZSTD, in_order[6:] + in_order[3:6] + in_order[:3][::-1])
    mcap("no_summary.mcap", CompressionType.NONE, messages(), index_types=IndexType.NONE, use_statistics=False, use_summary_offsets=False,
         repeat_channels=False, repeat_schemas=False)


if __name__ == "__main__":
    main()
