"""Writes small bags of ROS 1 (version 2.0, one chunk without compression), in the standard library alone."""
import math
import random
import struct

import support

HEADER_BYTES = 4096


def _text(value):
    value = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(value)) + value


def _header(stamp, frame):
    return struct.pack("<III", 0, int(stamp), round(stamp % 1 * 1e9)) + _text(frame)


def _pose(x, y, z, heading, roll=0.0):
    # roll of 0 or pi
    half = 0.5 * heading
    rotation = (math.cos(half), math.sin(half), 0.0, 0.0) if roll else (0.0, 0.0, math.sin(half), math.cos(half))
    return struct.pack("<7d", x, y, z, *rotation)


def scan(stamp, ranges, topic="/scan", frame="laser", time_increment=0.0):
    """Rays from -90 to +90 degrees."""
    fan = struct.pack("<7f", -math.pi / 2, math.pi / 2, math.pi / (len(ranges) - 1), time_increment, 0.0, 0.05, 30.0)
    data = _header(stamp, frame) + fan + struct.pack(f"<I{len(ranges)}fI", len(ranges), *ranges, 0)
    return topic, "sensor_msgs/LaserScan", stamp, data


def odometry(stamp, x, y, heading, topic="/odom", child="base_link"):
    data = _header(stamp, "odom") + _text(child) + _pose(x, y, 0.0, heading) + bytes(8 * (36 + 6 + 36))
    return topic, "nav_msgs/Odometry", stamp, data


def image(stamp, width, height, pixels, topic, frame="camera", encoding="mono8"):
    """Rows without gaps; of mono8 a byte for each pixel, of 16UC1 two, millimetres."""
    data = _header(stamp, frame) + struct.pack("<II", height, width) + _text(encoding) + b"\0" + struct.pack("<I", len(pixels) // height) + _text(pixels)
    return topic, "sensor_msgs/Image", stamp, data


def imu(stamp, yaw_rate, topic="/imu", frame="base_link"):
    """A unit that lies level, without an orientation of its own."""
    unknown, known = struct.pack("<9d", -1, *8 * [0.0]), struct.pack("<9d", 1e-6, 0, 0, 0, 1e-6, 0, 0, 0, 1e-6)
    data = _header(stamp, frame) + struct.pack("<4d", 0, 0, 0, 1) + unknown + struct.pack("<3d", 0, 0, yaw_rate) + known + struct.pack("<3d", 0, 0, 9.81) + known
    return topic, "sensor_msgs/Imu", stamp, data


def camera_info(stamp, width, height, focal, topic, frame="camera"):
    """Of a pinhole without distortion, whose centre is that of the picture."""
    x, y = (width - 1) / 2, (height - 1) / 2
    data = _header(stamp, frame) + struct.pack("<II", height, width) + _text("plumb_bob") + struct.pack("<I5d", 5, *5 * [0.0])
    data += struct.pack("<9d", focal, 0, x, 0, focal, y, 0, 0, 1) + struct.pack("<9d", 1, 0, 0, 0, 1, 0, 0, 0, 1)
    data += struct.pack("<12d", focal, 0, x, 0, 0, focal, y, 0, 0, 0, 1, 0) + bytes(8 + 17)
    return topic, "sensor_msgs/CameraInfo", stamp, data


def transforms(stamp, links, topic="/tf_static"):
    """`links`: (parent, child, x, y, z, heading, roll)."""
    data = struct.pack("<I", len(links))
    for parent, child, *pose in links:
        data += _header(stamp, parent) + _text(child) + _pose(*pose)
    return topic, "tf2_msgs/TFMessage", stamp, data


def cloud(stamp, points, with_rings, topic="/points", frame="laser", rows=1):
    """`points`: (x, y, z, ring)."""
    fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)] + ([("ring", 12, 4)] if with_rings else [])
    step = 14 if with_rings else 12
    data = _header(stamp, frame) + struct.pack("<III", rows, len(points) // rows, len(fields))
    for name, offset, kind in fields:
        data += _text(name) + struct.pack("<IBI", offset, kind, 1)
    packed = b"".join(struct.pack("<3fH", *point)[:step] for point in points)
    data += struct.pack("<BII", 0, step, len(packed) // rows) + _text(packed) + b"\x01"
    return topic, "sensor_msgs/PointCloud2", stamp, data


def _field(name, value):
    return _text(name.encode() + b"=" + value)


def _record(fields, data):
    return _text(b"".join(_field(name, value) for name, value in fields)) + _text(data)


def bag(messages):
    """The bytes of a bag of (topic, type, stamp, data)."""
    topics = {}
    for topic, kind, _, _ in messages:
        topics.setdefault((topic, kind), len(topics))
    connections = b"".join(
        _record([("op", b"\x07"), ("conn", struct.pack("<I", number)), ("topic", topic.encode())],
                _field("topic", topic.encode()) + _field("type", kind.encode()) + _field("md5sum", b"*") + _field("message_definition", b""))
        for (topic, kind), number in topics.items())
    records = b"".join(
        _record([("op", b"\x02"), ("conn", struct.pack("<I", topics[topic, kind])), ("time", struct.pack("<II", int(stamp), round(stamp % 1 * 1e9)))], data)
        for topic, kind, stamp, data in messages)
    inside = connections + records
    chunk = _record([("op", b"\x05"), ("compression", b"none"), ("size", struct.pack("<I", len(inside)))], inside)
    magic = b"#ROSBAG V2.0\n"
    start = len(magic) + HEADER_BYTES
    counts = b"".join(struct.pack("<II", number, sum(message[:2] == key for message in messages)) for key, number in topics.items())
    info = _record([("op", b"\x06"), ("ver", struct.pack("<I", 1)), ("chunk_pos", struct.pack("<Q", start)), ("count", struct.pack("<I", len(topics)))], counts)
    fields = [("op", b"\x03"), ("index_pos", struct.pack("<Q", start + len(chunk))), ("conn_count", struct.pack("<I", len(topics))), ("chunk_count", struct.pack("<I", 1))]
    padding = HEADER_BYTES - len(_record(fields, b""))
    return magic + _record(fields, b" " * padding) + chunk + connections + info


def drive(scans=30, robot="", shift=0.0, upside_down=False, time_increment=0.0):
    """Messages of a robot that drives along support's room; its laser stands 0.2 m ahead."""
    topics, frames = (f"/{robot}/", f"{robot}/") if robot else ("/", "")
    messages = [transforms(1000.0, [(frames + "base_link", frames + "laser", 0.2, 0.0, 0.3, 0.0, math.pi if upside_down else 0.0)])]
    for i in range(scans):
        x, y, heading, stamp = 2.0 + shift + 0.05 * i, 2.0 + 0.02 * i, 0.01 * i, 1000.0 + 0.2 * i
        messages.append(odometry(stamp, x, y, heading, topics + "odom", frames + "base_link"))
        ranges = support.room_ranges(x + 0.2 * math.cos(heading), y + 0.2 * math.sin(heading), heading)
        messages.append(scan(stamp, ranges[::-1] if upside_down else ranges, topics + "scan", frames + "laser", time_increment))
    return messages


def turning_drive(sweep_s, seed, scans=400):
    """A robot that turns at up to 1.7 rad/s in a room with pillars, ten scans a second whose rays take so long; and where it was, as lines of a TUM file."""
    noise, messages, truth, odom, last = random.Random(seed), [transforms(1000.0, [("base_link", "laser", 0.2, 0.0, 0.3, 0.0, 0.0)])], [], (0.0, 0.0, 0.0), None

    def pose(time):
        return 4.5 + 2.2 * math.cos(0.12 * time), 3.0 + math.sin(0.12 * time), 0.12 * time + 1.6 * math.sin(time)

    def range_at(time, angle):
        x, y, heading = pose(time)
        x, y, c, s = x + 0.2 * math.cos(heading), y + 0.2 * math.sin(heading), math.cos(heading + angle), math.sin(heading + angle)
        nearest = min(((9.0 if c > 0 else 0.0) - x) / c if abs(c) > 1e-9 else 1e9, ((6.0 if s > 0 else 0.0) - y) / s if abs(s) > 1e-9 else 1e9)
        for at_x, at_y, radius in ((6.0, 4.0, 0.4), (2.5, 4.6, 0.25), (7.5, 1.2, 0.3), (1.2, 1.5, 0.2), (4.2, 0.9, 0.15)):
            along, across = (at_x - x) * c + (at_y - y) * s, (at_y - y) * c - (at_x - x) * s
            if along > 0 and abs(across) < radius:
                nearest = min(nearest, along - math.sqrt(radius * radius - across * across))
        return nearest + noise.gauss(0.0, 0.01)

    for i in range(scans):
        time = 0.1 * i
        x, y, heading = pose(time)
        last = last or (x, y, heading)
        dx, dy, turned = x - last[0], y - last[1], 1.015 * (heading - last[2]) + noise.gauss(0.0, 0.002)
        apart = odom[2] - last[2]
        odom = (odom[0] + 1.02 * (math.cos(apart) * dx - math.sin(apart) * dy), odom[1] + 1.02 * (math.sin(apart) * dx + math.cos(apart) * dy), odom[2] + turned)
        last = (x, y, heading)
        messages.append(odometry(1000.0 + time, *odom))
        messages.append(scan(1000.0 + time, [range_at(time + sweep_s * k / 180, math.pi * (k / 180 - 0.5)) for k in range(181)], time_increment=sweep_s / 180))
        truth.append(f"{1000.0 + time:.6f} {x:.9f} {y:.9f} 0 0 0 {math.sin(heading / 2):.12f} {math.cos(heading / 2):.12f}\n")
    return messages, "".join(truth)


def cloud_drive(with_rings, scans=20, robot="", shift=0.0):
    """As drive(), with clouds of three heights: the lowest and highest see a wall that is nearer."""
    topics, frames = (f"/{robot}/", f"{robot}/") if robot else ("/", "")
    messages = [transforms(1000.0, [(frames + "base_link", frames + "laser", 0.0, 0.0, 0.3, 0.0, 0.0)])]
    for i in range(scans):
        x, y, stamp = 2.0 + shift + 0.05 * i, 2.0, 1000.0 + 0.2 * i
        messages.append(odometry(stamp, x, y, 0.0, topics + "odom", frames + "base_link"))
        points = []
        for k, distance in enumerate(support.room_ranges(x, y, 0.0)):
            angle = math.pi * (k / 180 - 0.5)
            for ring, (height, share) in enumerate([(-0.25, 0.6), (0.0, 1.0), (0.25, 0.7)]):
                points.append((share * distance * math.cos(angle), share * distance * math.sin(angle), height, ring))
        messages.append(cloud(stamp, points, with_rings, topics + "points", frames + "laser"))
    return messages


def depth_drive(as_cloud, frames=5):
    """A camera's colour pictures, with depth that is registered to them: as images or as organised clouds."""
    width, height, focal, messages = 32, 24, 30.0, []
    for i in range(frames):
        stamp = 1000.0 + 0.1 * i
        messages += [camera_info(stamp, width, height, focal, "/camera/rgb/camera_info"),
                     image(stamp, width, height, bytes((3 * k + i) % 256 for k in range(width * height)), "/camera/rgb/image_rect_color")]
        depths = [math.nan if k % 7 == 0 else 1.0 + 0.01 * i + 0.0037 * k for k in range(width * height)]
        if as_cloud:
            points = [((k % width - (width - 1) / 2) / focal * z, (k // width - (height - 1) / 2) / focal * z, z, 0) for k, z in enumerate(depths)]
            messages.append(cloud(stamp, points, False, "/camera/depth_registered/points", "camera", height))
        else:
            messages.append(image(stamp, width, height, struct.pack(f"<{len(depths)}f", *depths), "/camera/depth_registered/image_rect", encoding="32FC1"))
    return messages
