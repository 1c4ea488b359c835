"""Publishes pickled messages (topic, type, seconds from the start, serialized) over ROS:  ros_player.py FILE SPEED [SUBSCRIBERS]

Begins when each topic but those of transforms has SUBSCRIBERS (1); prints "begins", then "ended". A line "clock" in MAPWEAVE_PLAYER makes it
publish /clock too; "again" plays everything twice; "eager" begins when two topics have subscribers; "keep" stays until standard input ends, as a robot does whose battery lasts.
"""
import os
import pickle
import sys
import time

import roslib.message
import rospy
from rosgraph_msgs.msg import Clock

with open(sys.argv[1], "rb") as file:
    MESSAGES = pickle.load(file)
SPEED, SUBSCRIBERS = float(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1
MODES = os.environ.get("MAPWEAVE_PLAYER", "").split()
rospy.init_node("player", anonymous=True, disable_signals=True)
publishers = {}
for topic, kind, _, _ in MESSAGES:
    if topic not in publishers:
        publishers[topic] = rospy.Publisher(topic, roslib.message.get_message_class(kind), queue_size=10000, latch=topic.endswith("tf_static"))
clock = rospy.Publisher("/clock", Clock, queue_size=100) if "clock" in MODES else None
waited = [publisher for topic, publisher in publishers.items() if "tf" not in topic]


static = {}   # transforms by child: the last message stays with the topic, and holds all, as of any broadcaster of static transforms


def message_of(topic, kind, data):
    message = roslib.message.get_message_class(kind)().deserialize(data)
    if topic.endswith("tf_static"):
        static.update({one.child_frame_id: one for one in message.transforms})
        message.transforms = list(static.values())
    return message


def tick(seconds):
    if clock:
        clock.publish(Clock(rospy.Time.from_sec(seconds)))


first = MESSAGES[0][2]
while sum(publisher.get_num_connections() >= SUBSCRIBERS for publisher in waited) < (2 if "eager" in MODES else len(waited)):
    tick(first)
    time.sleep(0.02)
print("begins", flush=True)
for _ in range(2 if "again" in MODES else 1):
    began = time.time()
    for topic, kind, stamp, data in MESSAGES:
        time.sleep(max(0.0, began + (stamp - first) / SPEED - time.time()))
        tick(stamp)
        publishers[topic].publish(message_of(topic, kind, data))
    time.sleep(0.3)
print("ended", flush=True)
if "keep" in MODES:
    sys.stdin.read()
time.sleep(0.5)
