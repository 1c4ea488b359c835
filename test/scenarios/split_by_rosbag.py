"""Writes messages into bags as `rosbag record --split` does, by ROS 1's own library. Run by an interpreter that has it:

    split_by_rosbag.py PARTS PREFIX none|bz2|lz4 < MESSAGES

MESSAGES: JSON, of each message its topic, type, time in seconds, and bytes as hexadecimal digits.
"""
import json
import sys

import genpy
import rosbag
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

TYPES = {"sensor_msgs/LaserScan": LaserScan, "nav_msgs/Odometry": Odometry, "tf2_msgs/TFMessage": TFMessage}

if __name__ == "__main__":
    count, prefix, compression = int(sys.argv[1]), sys.argv[2], sys.argv[3]
    messages = json.load(sys.stdin)
    for part in range(count):
        with rosbag.Bag(f"{prefix}_2026-01-02-03-{part:02}-00_{part}.bag", "w", compression=compression) as out:
            for topic, kind, seconds, data in messages[part * len(messages) // count:(part + 1) * len(messages) // count]:
                out.write(topic, TYPES[kind]().deserialize(bytes.fromhex(data)), genpy.Time.from_sec(seconds))
