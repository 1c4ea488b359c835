"""Publishes pickled messages over ROS as they were sensed, and measures how soon a scan is in its robot's map:  ros_drive.py FILE SPEED

Messages: (topic, type, seconds, serialized), by time. Begins once each scan and odometry topic has a subscriber. Prints JSON: median_s, p95_s and longest_s from the publication of a
scan to the arrival of the robot's map (its grid) that was drawn with it: that was sent after a path with a pose of its stamp. Scans that the map leaves out, since the robot stood still,
do not count.
"""
import collections
import json
import pickle
import struct
import sys
import threading
import time

import roslib.message
import rospy
from nav_msgs.msg import Path

with open(sys.argv[1], "rb") as file:
    MESSAGES = pickle.load(file)
SPEED = float(sys.argv[2])
rospy.init_node("drive", anonymous=True, disable_signals=True)
classes = {kind: roslib.message.get_message_class(kind) for _, kind, _, _ in MESSAGES}
publishers = {topic: rospy.Publisher(topic, classes[kind], queue_size=10000, latch=topic == "/tf_static") for topic, kind in {(topic, kind) for topic, kind, _, _ in MESSAGES}}
lock, waiting, took = threading.Lock(), collections.defaultdict(collections.deque), []
# Of a robot: paths that no map came after yet, as when they were sent and the stamps of their poses; its last maps, as when they were sent and came.
paths, maps = collections.defaultdict(collections.deque), collections.defaultdict(lambda: collections.deque(maxlen=50))


def time_scans(robot):
    """A map has the poses of the paths that were sent before it; what was sent first may come last."""
    while paths[robot]:
        sent, stamps = paths[robot][0]
        came = [at for map_sent, at in maps[robot] if map_sent >= sent]
        if not came:
            return
        paths[robot].popleft()
        while waiting[robot] and waiting[robot][0][0] <= max(stamps):
            stamp, published = waiting[robot].popleft()
            if stamp in stamps:
                took.append(came[0] - published)


def take_path(path, robot):
    with lock:
        if path.poses:
            paths[robot].append((path.header.stamp.to_nsec(), {pose.header.stamp.to_nsec() for pose in path.poses[-2000:]}))
        time_scans(robot)


def take_map(grid, robot):
    now = time.time()
    seconds, nanoseconds = struct.unpack_from("<II", grid._buff, 4)   # of its header's stamp
    with lock:
        maps[robot].append((seconds * 1_000_000_000 + nanoseconds, now))
        time_scans(robot)


for robot in {topic.split("/")[1] for topic in publishers if topic.endswith("/scan")}:
    rospy.Subscriber(f"/{robot}/path", Path, take_path, robot, queue_size=10)
    rospy.Subscriber(f"/{robot}/map", rospy.AnyMsg, take_map, robot, queue_size=10)
while any(publisher.get_num_connections() == 0 for topic, publisher in publishers.items() if topic != "/tf_static"):
    time.sleep(0.05)
began = time.time()
for topic, kind, stamp, data in MESSAGES:
    time.sleep(max(0.0, began + (stamp - MESSAGES[0][2]) / SPEED - time.time()))
    message = classes[kind]().deserialize(data)
    if topic.endswith("/scan"):
        with lock:
            waiting[topic.split("/")[1]].append((message.header.stamp.to_nsec(), time.time()))
    publishers[topic].publish(message)
time.sleep(5.0)
took.sort()
print(json.dumps({"scans": len(took), "median_s": took[len(took) // 2] if took else None, "p95_s": took[int(0.95 * len(took))] if took else None,
                  "longest_s": took[-1] if took else None}))
