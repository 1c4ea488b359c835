"""Sensors of robots of ROS 1 other than lasers: their map is that of the recording."""
import math
import struct
import zlib

import ros1_bags
import support
from ros_scenario import RosScenario


def grey_pixels(png):
    """(width, height, bytes) of a grey picture of 8 or 16 bits, as PNG has them."""
    at, packed = 8, b""
    while at < len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        if kind == b"IHDR":
            width, height, bits, colours = struct.unpack_from(">IIBB", png, at + 8)
            assert bits in (8, 16) and colours == 0
            pixel = bits // 8
        elif kind == b"IDAT":
            packed += png[at + 8:at + 8 + length]
        at += 12 + length
    step = width * pixel
    raw, rows, above = zlib.decompress(packed), [], bytes(step)
    for y in range(height):
        line, row = raw[y * (step + 1):(y + 1) * (step + 1)], bytearray(step)
        how = line[0]
        for x, (value, up) in enumerate(zip(line[1:], above)):
            left, corner = (row[x - pixel], above[x - pixel]) if x >= pixel else (0, 0)
            if how == 1:
                value += left
            elif how == 2:
                value += up
            elif how == 3:
                value += (left + up) // 2
            elif how == 4:
                off_left, off_up, off_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
                value += left if off_left <= off_up and off_left <= off_corner else up if off_up <= off_corner else corner
            row[x] = value & 255
        above = bytes(row)
        rows.append(above)
    return width, height, b"".join(rows)


WORLD = """
seed: 7
buildings: [{kind: apartment, apartment: {width_m: 8, height_m: 7}}]
cameras: [{id: eye, kind: KIND, width: 320, height: 240, fx: 262, fy: 262, frames_per_second: 5}]
logs: {layout: folders}
robots: [{id: alpha, length_m: 2}]
"""


class RosSensors(RosScenario):
    def mapped(self, messages, recorded, *options, robots=("tb0",)):
        """A team maps what robots publish; the results are those of `run` with the recordings. `recorded`: topics that must be."""
        node = self.team(*options, robots=robots)
        self.await_word(self.play(sorted(messages, key=lambda message: message[2]), 8.0, 1, "keep"), "ended")
        said = node.log.read_text()
        for topic in recorded:
            self.assertIn(topic, said)
        self.finish(node)
        self.same_results("batch", *options)

    def run_recordings(self, out, *options):
        self.mapweave("run", "maps.logs/run.yaml", "--out", out, *options)
        return [path.relative_to(self.folder / out) for path in (self.folder / out).rglob("*") if path.name in ("map.mwdb", "map.pgm", "trajectory.tum")]

    def same_results(self, out, *options):
        results = self.run_recordings(out, *options)
        self.assertGreater(len(results), 1)
        for result in results:
            self.assertEqual((self.folder / "maps" / result).read_bytes(), (self.folder / out / result).read_bytes(), result)

    def robots(self):
        return self.read_json("maps/summary.json")["robots"]

    def simulated(self, kind):
        """Pictures of a simulated camera: (stamp, width, height, grey values, millimetres or None), by time."""
        self.mapweave("simulate", self.write("world.yaml", WORLD.replace("KIND", kind)), "--out", "world")
        pictures = []
        for path in sorted((self.folder / "world").glob("alpha_*/rgb/*.png")):
            width, height, grey = grey_pixels(path.read_bytes())
            depth = path.parents[1] / "depth" / path.name
            if depth.exists():   # 5,000 to the metre, the high byte first
                values = struct.unpack(f">{width * height}H", grey_pixels(depth.read_bytes())[2])
                millimetres = struct.pack(f"<{width * height}H", *(value // 5 for value in values))
            pictures.append((float(path.stem), width, height, grey, millimetres if depth.exists() else None))
        self.assertGreater(len(pictures), 30)
        return pictures

    def camera_messages(self, pictures, robot):
        messages = []
        for stamp, width, height, grey, millimetres in pictures:
            for name, pixels, encoding in (("color", grey, "mono8"), ("aligned_depth_to_color", millimetres, "16UC1")):
                if pixels is not None:
                    topic = f"/{robot}/camera/{name}/"
                    messages.append(ros1_bags.camera_info(stamp, width, height, 262.0, topic + "camera_info"))
                    messages.append(ros1_bags.image(stamp, width, height, pixels, topic + "image_raw", encoding=encoding))
        return messages

    def test_a_robot_with_a_camera_is_mapped_as_its_recording(self):
        self.mapped(self.camera_messages(self.simulated("mono"), "eye"), ["/eye/camera/color/image_raw"], robots=["eye"])
        self.assertGreater(self.robots()[0]["cameras"][0]["tracked"], 20)

    def test_a_robot_with_a_depth_camera_is_mapped_as_its_recording(self):
        self.mapped(self.camera_messages(self.simulated("rgbd"), "eye"), ["/eye/camera/color/image_raw", "/eye/camera/aligned_depth_to_color/image_raw"],
                    robots=["eye"])
        camera = self.robots()[0]["cameras"][0]
        self.assertEqual(camera["kind"], "rgbd")
        self.assertGreater(camera["tracked"], 20)

    def test_depth_pictures_are_mapped_as_scans_as_their_recording(self):
        self.mapped(self.camera_messages(self.simulated("rgbd"), "eye"), ["/eye/camera/aligned_depth_to_color/image_raw"], "--set", "sensor=depth",
                    robots=["eye"])
        self.assertGreater(self.robots()[0]["scans"], 20)

    def test_robots_with_lidars_are_mapped_as_their_recordings(self):
        # With rings the most level one is the laser, without them a slice of heights.
        messages = ros1_bags.cloud_drive(True, 40, "tb0") + ros1_bags.cloud_drive(False, 40, "tb1", 0.8)
        self.mapped(messages, ["/tb0/points", "/tb1/points"], robots=["tb0", "tb1"])
        self.assertEqual([robot["scans"] for robot in self.robots()], [40, 40])
        rows = int((self.folder / "maps/team/map.pgm").read_bytes().split(maxsplit=3)[2])
        self.assertAlmostEqual(0.05 * rows, 6.0, delta=0.5)   # what rays above and below see is nearer

    def test_an_inertial_unit_beside_a_laser_counts_as_in_its_recording(self):
        def heading(seconds):
            return 0.8 * math.sin(0.8 * seconds)

        messages = [ros1_bags.transforms(1000.0, [("tb0/base_link", "tb0/laser", 0.0, 0.0, 0.3, 0.0, 0.0)])]
        for i in range(70):
            x, y, seconds = 2.0 + 0.03 * i, 2.0 + 0.02 * i, 0.2 * i
            messages.append(ros1_bags.odometry(1000.0 + seconds, x, y, 1.3 * heading(seconds), "/tb0/odom", "tb0/base_link"))   # wheels that slip
            messages.append(ros1_bags.scan(1000.0 + seconds, support.room_ranges(x, y, heading(seconds)), "/tb0/scan", "tb0/laser"))
        messages += [ros1_bags.imu(1000.0 + 0.02 * i, 0.64 * math.cos(0.016 * i), "/tb0/imu", "tb0/base_link") for i in range(700)]
        self.mapped(messages, ["/tb0/imu"])
        self.run_recordings("without", "--set", "reading.topics=[/tb0/scan,/tb0/odom]")
        trajectory = "robots/tb0/trajectory.tum"
        self.assertNotEqual((self.folder / "maps" / trajectory).read_bytes(), (self.folder / "without" / trajectory).read_bytes())


if __name__ == "__main__":
    support.main()
