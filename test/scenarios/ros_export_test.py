"""`export --bag` and `--mcap`: what the Python packages rosbags and mcap read is the map, the paths and the poses that the other files hold."""
import json
import pathlib
import shutil
import subprocess
import unittest

import support
from support import BAD_INPUT, CANNOT_WRITE, USAGE

READERS = pathlib.Path(__file__).with_name("ros_readers.py")


def pgm(path):
    """Columns, rows, and shades from the lowest row up."""
    data = path.read_bytes()
    magic, size, most, pixels = data.split(b"\n", 3)
    columns, rows = map(int, size.split())
    assert (magic, most) == (b"P5", b"255")
    lines = [pixels[row * columns:(row + 1) * columns] for row in range(rows)]
    return columns, rows, b"".join(reversed(lines))


def tum(path):
    return [list(map(float, line.split())) for line in path.read_text().splitlines() if line and not line.startswith("#")]


def turned(quaternion, vector):
    x, y, z, w = quaternion
    cross = [y * vector[2] - z * vector[1], z * vector[0] - x * vector[2], x * vector[1] - y * vector[0]]
    twice = [y * cross[2] - z * cross[1], z * cross[0] - x * cross[2], x * cross[1] - y * cross[0]]
    return [vector[i] + 2 * (w * cross[i] + twice[i]) for i in range(3)]


class Recordings(support.Scenario):
    def read(self, by, name):
        done = subprocess.run([support.ros_interpreter(), READERS, by, self.folder / name], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def both(self, source, *options):
        """The topics of a bag and an MCAP file of a result, the latter read by both packages."""
        self.mapweave("export", source, "--bag", "ros1.bag", "--mcap", "ros2.mcap", *options)
        return {"bag": self.read("rosbags", "ros1.bag"), "mcap": self.read("mcap", "ros2.mcap"), "mcap by rosbags": self.read("rosbags", "ros2.mcap")}

    def only(self, topics, name, kind):
        topic = topics[name]
        self.assertEqual(topic["type"], kind)
        self.assertEqual(len(topic["messages"]), 1, name)
        return topic["messages"][0][1]

    def check_grid(self, topics, folder, name="/map"):
        grid = self.only(topics, name, "nav_msgs/msg/OccupancyGrid")
        columns, rows, shades = pgm(folder / "map.pgm")
        self.assertEqual((grid["width"], grid["height"]), (columns, rows))
        self.assertEqual(grid["cells"], [{0: 100, 254: 0, 205: -1}[shade] for shade in shades])
        self.assertGreater(grid["cells"].count(100), 20)
        self.assertGreater(grid["cells"].count(0), 500)
        yaml = dict(line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
        self.assertAlmostEqual(grid["resolution"], float(yaml["resolution"]), 6)
        for found, wanted in zip(grid["origin"], json.loads(yaml["origin"])[:2] + [0, 0, 0, 0, 1]):
            self.assertAlmostEqual(found, wanted, 9)

    def check_robot(self, topics, robot, trajectory, frame="map"):
        path = self.only(topics, f"/{robot}/path", "nav_msgs/msg/Path")
        self.assertEqual(path["frame"], frame)
        self.assertEqual(len(path["poses"]), len(trajectory))
        for found, wanted in zip(path["poses"], trajectory):
            self.assertLess(max(abs(a - b) for a, b in zip(found, wanted)), 1e-5)
        start, = [one for one in self.only(topics, "/tf_static", "tf2_msgs/msg/TFMessage") if one["child"] == f"{robot}/map"]
        self.assertEqual(start["parent"], frame)
        poses = [one for _, message in topics["/tf"]["messages"] for one in message if one["child"] == f"{robot}/base_link"]
        self.assertEqual({one["parent"] for one in poses}, {f"{robot}/map"})
        self.assertEqual(len(poses), len(trajectory))
        for one, wanted in zip(poses, trajectory):
            self.assertAlmostEqual(one["stamp"], wanted[0], 5)
            place = turned(start["pose"][3:], one["pose"][:3])
            for axis in range(3):
                self.assertAlmostEqual(start["pose"][axis] + place[axis], wanted[1 + axis], 4)

    def check_points(self, topics, folder, name="/points"):
        cloud = self.only(topics, name, "sensor_msgs/msg/PointCloud2")
        self.assertEqual(cloud["fields"], [["x", 0, 7], ["y", 4, 7], ["z", 8, 7], ["rgb", 12, 7]])
        self.assertEqual((cloud["height"], cloud["point_step"], cloud["is_dense"]), (1, 16, True))
        data = (folder / "map.pcd").read_bytes()
        self.assertEqual(bytes.fromhex(cloud["data"]), data[data.index(b"DATA binary\n") + len(b"DATA binary\n"):])
        self.assertEqual(16 * cloud["width"], len(cloud["data"]) // 2)

    def test_a_robot_s_map_is_read_as_its_other_files_have_it(self):
        support.ros_interpreter()
        self.write("room.log", "\n".join(support.room_lines(40)) + "\n")
        self.mapweave("slam", "room.log", "--out", "map", "--robot", "my-robot")
        out = self.folder / "map"
        for by, topics in self.both("map").items():
            with self.subTest(by):
                self.assertEqual(set(topics), {"/map", "/points", "/my_robot/path", "/tf", "/tf_static"})
                self.check_grid(topics, out)
                self.check_points(topics, out)
                self.check_robot(topics, "my_robot", tum(out / "trajectory.tum"))
                received = [message[0] for topic in topics.values() for message in topic["messages"]]
                self.assertEqual(min(received), round(tum(out / "trajectory.tum")[0][0] * 1e9))
                for name, topic in topics.items():
                    self.assertEqual(topic.get("md5"), topic.get("md5_of_definition"), name)
                    self.assertEqual(topic.get("latched", name != "/tf"), name != "/tf", name)
                    self.assertEqual(topic.get("count", len(topic["messages"])), len(topic["messages"]), name)

    def test_a_team_s_robots_hang_on_its_frame(self):
        support.ros_interpreter()
        self.write("room.log", "\n".join(support.room_lines(60)) + "\n")
        self.mapweave("split", "room.log", "--robots", "2", "--overlap", "2", "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "team", code=(support.DONE, support.APART))
        team = self.folder / "team/team"
        self.assertTrue((team / "map.mwdb").exists(), "the two halves of a room were not merged")
        for by, topics in self.both(team).items():
            with self.subTest(by):
                self.check_grid(topics, team)
                self.check_points(topics, team)
                for robot in ("robot0", "robot1"):
                    self.check_robot(topics, robot, tum(team / f"trajectories/{robot}.tum"))
        one = self.folder / "one"
        self.mapweave("export", team, "--robot", "robot1", "--bag", "one.bag", "--out", one, "--pgm", "--pcd", "--tum")
        topics = self.read("rosbags", "one.bag")
        self.assertEqual(set(topics), {"/map", "/points", "/robot1/path", "/tf", "/tf_static"})
        self.check_grid(topics, one)
        self.check_robot(topics, "robot1", tum(one / "trajectory.tum"))


class Files(support.Scenario):
    def setUp(self):
        super().setUp()
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.mapweave("slam", "room.log", "--out", "map")

    def test_recordings_need_no_folder_and_all_else_does(self):
        done = self.mapweave("export", "map", "--mcap", "a.mcap", "--json")
        self.assertEqual(json.loads(done.stdout), ["a.mcap"])
        self.assertEqual({path.name for path in self.folder.iterdir()}, {"room.log", "map", "a.mcap"})
        self.assert_says(self.mapweave("export", "map", code=USAGE), "--out")
        self.assert_says(self.mapweave("export", "map", "--bag", "a.bag", "--png", code=USAGE), "--out")
        self.assertFalse((self.folder / "a.bag").exists())
        self.mapweave("export", "map", "--bag", "a.bag", "--out", "folder")
        self.assertTrue((self.folder / "a.bag").read_bytes().startswith(b"#ROSBAG V2.0\n"))
        self.assertTrue((self.folder / "folder/map.pgm").exists())

    def test_the_same_map_makes_the_same_bytes(self):
        for name in ("a", "b"):
            self.mapweave("export", "map", "--bag", f"{name}.bag", "--mcap", f"{name}.mcap")
        for ending in (".bag", ".mcap"):
            self.assertEqual((self.folder / f"a{ending}").read_bytes(), (self.folder / f"b{ending}").read_bytes())

    @unittest.skipUnless(shutil.which("rosbag"), "needs Debian's rosbag")
    def test_ros_1_s_own_rosbag_reads_the_bag(self):
        self.mapweave("export", "map", "--bag", "a.bag")
        done = subprocess.run(["rosbag", "info", "--yaml", self.folder / "a.bag"], capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        poses = len((self.folder / "map/trajectory.tum").read_text().splitlines())
        self.assertIn(f"messages: {poses + 4}\n", done.stdout)
        self.assertIn("indexed: True", done.stdout)

    def test_a_recording_that_is_there_is_not_lost(self):
        self.write("old.bag", "a recording")
        self.assert_says(self.mapweave("export", "map", "--bag", "old.bag", code=CANNOT_WRITE), "old.bag", "--force")
        self.assertEqual((self.folder / "old.bag").read_text(), "a recording")
        self.mapweave("export", "map", "--bag", "old.bag", "--force")
        self.assertGreater((self.folder / "old.bag").stat().st_size, 4096)
        self.assert_says(self.mapweave("export", "map", "--bag", "map/map.mwdb", "--force", code=USAGE), "map.mwdb")
        self.assert_says(self.mapweave("export", "map", "--bag", "x", "--mcap", "x", code=USAGE), "same file")
        self.assert_says(self.mapweave("export", "map", "--bag", "no/such/folder/a.bag", code=(CANNOT_WRITE, BAD_INPUT)), "no/such/folder")

    def test_a_grid_alone_has_neither_robots_nor_stamps(self):
        self.mapweave("export", "map/map.yaml", "--bag", "grid.bag", "--mcap", "grid.mcap")
        bag = (self.folder / "grid.bag").read_bytes()
        self.assertIn(b"nav_msgs/OccupancyGrid", bag)
        self.assertNotIn(b"nav_msgs/Path", bag)


if __name__ == "__main__":
    support.main()
