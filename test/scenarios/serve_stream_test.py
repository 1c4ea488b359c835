"""Recordings of ROS 2 through a pipe: a robot that sends what its recorder writes, while it writes it, gets the map of the file."""
import pickle
import struct
import subprocess
import time

import ros1_bags
import serve_test
import support

WRITER = support.ROOT / "scripts/evaluation/write_bag.py"
MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6
TEAM = "robots:\n  - {id: tb0, log: tb0.mcap, edge: north}\n"


def records(data):
    """(opcode, all bytes of the record), in their order."""
    at = 0
    while at < len(data):
        end = at + 9 + struct.unpack_from("<Q", data, at + 1)[0]
        yield data[at], data[at:end]
        at = end


def message_by_message(recording):
    """The same messages as `ros2 bag record` writes them without chunks: each topic is described before its first message."""
    pieces, schemas, channels, topics = [], {}, {}, 0
    for opcode, record in records(recording[len(MAGIC):-len(MAGIC)]):
        if opcode != CHUNK:
            continue
        assert struct.unpack_from("<I", record, 37)[0] == 0, "a chunk that is not compressed"
        for inner, one in records(record[49:]):
            number = struct.unpack_from("<H", one, 9)[0]
            if inner == SCHEMA:
                schemas[number] = one
            elif inner == CHANNEL:
                channels[number] = schemas[struct.unpack_from("<H", one, 11)[0]] + one
            elif inner == MESSAGE:
                pieces.append(channels.pop(number, b"") + one)
                topics += len(pieces[-1]) > len(one)
    header = next(record for _, record in records(recording[len(MAGIC):]))
    end = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + MAGIC
    assert topics == 3 and not channels
    return [MAGIC + header, *pieces, end]


class Streams(serve_test.WithBroker):
    def recorded(self, scans=40):
        """An MCAP recording, of ROS 2."""
        (self.folder / "messages").write_bytes(pickle.dumps([(topic, kind, round(stamp * 1e9), data) for topic, kind, stamp, data in ros1_bags.drive(scans)]))
        done = subprocess.run([support.ros_interpreter(), "-B", WRITER, "messages", "mcap:1:whole.mcap"], cwd=self.folder, capture_output=True, text=True,
                              timeout=60 * support.PATIENCE, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return (self.folder / "whole.mcap").read_bytes()

    def start_deployment(self):
        self.write("team.yaml", TEAM)
        self.talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=0", "--set", "live.preview_period_s=1"]
        self.others = [self.start("serve", "cloud", "team.yaml", "--out", "live", *self.talk),
                       self.start("serve", "edge", "team.yaml", "--name", "north", *self.talk)]

    def start_robot(self):
        robot = subprocess.Popen([support.PROGRAM, "serve", "robot", "team.yaml", "--stdin", *self.talk], cwd=self.folder, env=support.environment(),
                                 stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(lambda: (robot.poll() is None and robot.kill(), robot.wait(), robot.stdin.close(), robot.stderr.close()))
        return robot

    def assert_map_of_the_file(self, pieces, pace_s):
        self.start_deployment()
        robot = self.start_robot()
        for piece in pieces:
            self.feed(robot, [piece])
            time.sleep(pace_s)
        error = robot.communicate(timeout=120 * support.PATIENCE)[1].decode()
        self.assertEqual(robot.returncode, support.DONE, error)
        self.assertIn("its edge has all 40 scans", error)
        self.assert_same_map_as("whole.mcap")

    def test_messages_that_come_one_by_one_are_mapped_as_the_file(self):
        pieces = message_by_message(self.recorded())
        (self.folder / "whole.mcap").write_bytes(b"".join(pieces))
        self.assert_map_of_the_file(pieces, 0.05)

    def test_a_recording_in_chunks_is_mapped_as_the_file(self):
        whole = self.recorded()
        step = len(whole) // 20 + 1
        self.assert_map_of_the_file([whole[begin:begin + step] for begin in range(0, len(whole), step)], 0.1)

    def feed(self, robot, pieces):
        for piece in pieces:
            robot.stdin.write(piece)
            robot.stdin.flush()

    def kill_in_the_middle(self, pieces):
        """A robot that is killed once its edge has some of the first half."""
        self.start_deployment()
        robot = self.start_robot()
        self.feed(robot, pieces[:len(pieces) // 2])
        log, half = self.folder / "tb0.mcap", sum(map(len, pieces[:len(pieces) // 2]))
        self.wait_for(lambda: log.is_file() and log.stat().st_size == half, "half of it is kept")
        robot.kill()
        robot.wait()
        self.assertTrue((self.folder / "tb0.mcap.unsent").is_file())

    def assert_same_map_as(self, recording):
        for process in self.others:
            self.end(process)
        self.write("file.yaml", TEAM.replace("tb0.mcap", recording))
        self.mapweave("run", "file.yaml", "--out", "run")
        for name in ("team/map.mwdb", "team/map.pgm", "robots/tb0/trajectory.tum"):
            self.assertEqual((self.folder / "live" / name).read_bytes(), (self.folder / "run" / name).read_bytes(), name)

    def test_a_robot_that_is_killed_goes_on_with_the_same_stream(self):
        pieces = message_by_message(self.recorded())
        (self.folder / "whole.mcap").write_bytes(b"".join(pieces))
        self.kill_in_the_middle(pieces)
        other = self.start_robot()
        self.feed(other, [b"".join(pieces[:3]) + b"another drive"])
        error = other.communicate(timeout=60 * support.PATIENCE)[1].decode()
        self.assertEqual(other.returncode, support.BAD_INPUT, error)
        self.assertIn("another drive than the one that an earlier program kept", error)
        robot = self.start_robot()
        self.feed(robot, pieces)
        error = robot.communicate(timeout=120 * support.PATIENCE)[1].decode()
        self.assertEqual(robot.returncode, support.DONE, error)
        self.assertIn("goes on with", error)
        self.assertEqual((self.folder / "tb0.mcap").read_bytes(), b"".join(pieces))
        self.assertFalse((self.folder / "tb0.mcap.unsent").exists())
        self.assert_same_map_as("whole.mcap")

    def test_a_robot_that_was_killed_sends_what_it_kept(self):
        pieces = message_by_message(self.recorded())
        self.kill_in_the_middle(pieces)
        (self.folder / "half.mcap").write_bytes((self.folder / "tb0.mcap").read_bytes())
        robot = self.start("serve", "robot", "team.yaml", *self.talk)
        self.assertRegex(self.end(robot)[1], r"its edge has all \d+ scans")
        self.assertFalse((self.folder / "tb0.mcap.unsent").exists())
        self.assert_same_map_as("half.mcap")

    def test_a_bag_of_ros_1_is_not_read_while_it_is_written(self):
        start = ros1_bags.bag(ros1_bags.drive(100))[:100_000]
        self.start_deployment()
        robot = self.start_robot()
        robot.stdin.write(start)
        robot.stdin.flush()
        self.assertIn("record as MCAP", next(line for line in robot.stderr if b"warning: robot tb0" in line).decode())   # the pipe stays open


if __name__ == "__main__":
    support.main()
