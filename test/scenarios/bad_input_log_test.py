"""Logs that are damaged, empty or not what they seem: a message that names file and place, exit code 3, nothing half-written."""
import gzip
import struct

import support
from support import APART, BAD_INPUT, DONE


class BadLog(support.Scenario):
    def refuse(self, name, *words):
        """slam, convert and split refuse the log `name`, say why, and leave nothing."""
        for verb in (("slam", name, "--out", "out"), ("convert", name, "out.rawlog"), ("split", name, "--robots", "2", "--out", "parts")):
            with self.subTest(f"{name}: {verb[0]}"):
                self.assert_says(self.mapweave(*verb, code=BAD_INPUT), name, *words)
                self.assert_nothing_left("out", "out.rawlog", "parts")

    def write_bytes(self, name, data):
        (self.folder / name).write_bytes(data)
        return name

    def test_a_log_cut_short_is_refused_wherever_it_was_cut(self):
        whole = support.need(support.MALAGA).read_bytes()
        for place in (1, 9, 10, 100, 5000, len(whole) // 3, len(whole) - 9, len(whole) - 1):
            name = self.write_bytes(f"cut{place}.rawlog", whole[:place])
            with self.subTest(place):
                self.assert_says(self.mapweave("slam", name, "--out", "out", code=BAD_INPUT), name)
                self.assert_nothing_left("out")
        self.refuse(self.write_bytes("cut.rawlog", whole[:len(whole) // 2]), "byte")

    def test_a_plain_log_cut_within_an_object_is_refused(self):
        data = support.malaga_bytes()
        for place in (3, 30, 1000, len(data) // 2 + 7, len(data) - 1):
            name = self.write_bytes(f"plain{place}.rawlog", data[:place])
            with self.subTest(place):
                self.assert_says(self.mapweave("slam", name, "--out", "out", code=BAD_INPUT), name)
                self.assert_nothing_left("out")

    def test_a_corrupted_gz_is_refused(self):
        data = bytearray(support.need(support.MALAGA).read_bytes())
        for i in range(1000):
            data[80000 + i] ^= 0x5A
        self.refuse(self.write_bytes("corrupt.rawlog", bytes(data)), "byte")
        data = bytearray(support.MALAGA.read_bytes())
        data[-6] ^= 0xFF   # the checksum at the end alone
        self.refuse(self.write_bytes("checksum.rawlog", bytes(data)))

    def test_an_unknown_class_is_named(self):
        data = support.malaga_bytes()
        place = data.index(b"CObservation2DRangeScan", 100000)
        data = data[:place] + b"CObservation2DRangeSpam" + data[place + 23:]
        self.refuse(self.write_bytes("unknown.rawlog", gzip.compress(data, 1)), "CObservation2DRangeSpam", "byte")

    def test_a_scan_of_an_old_version_is_refused_before_memory_is_asked_for(self):
        data = bytearray(support.malaga_bytes())
        place = data.index(b"CObservation2DRangeScan", 100000) + len(b"CObservation2DRangeScan")
        data[place] = 3   # its version
        self.refuse(self.write_bytes("old.rawlog", gzip.compress(bytes(data), 1)), "CObservation2DRangeScan", "version 3")

    def test_numbers_too_large_are_no_zeros(self):
        lines = support.room_lines(20)
        words = lines[10].split()
        words[-6] = "1e400"
        lines[10] = " ".join(words)
        self.write("large.log", "\n".join(lines) + "\n")
        self.refuse("large.log", ".log:11", "finite")

    def test_ranges_that_are_no_numbers_are_refused(self):
        data = bytearray(support.malaga_bytes())
        place = support.place_of_ranges(data, 50)
        struct.pack_into("<f", data, place + 4 * 2, float("nan"))   # a ray that is marked valid
        self.refuse(self.write_bytes("nan.rawlog", gzip.compress(bytes(data), 1)), "nan")

    def test_odometry_that_runs_away_is_no_reason_to_fail(self):
        lines = support.room_lines(40)
        for place in (1e3, 1e6, 1e12):
            words = [line.split() for line in lines]
            for line in words[20:]:
                line[-6] = line[-9] = str(place)   # x of the laser and of the odometry
            self.write("far.log", "\n".join(map(" ".join, words)) + "\n")
            with self.subTest(place):
                done = self.mapweave("slam", "far.log", "--out", "out", "--force")
                self.assertIn("odometry jumps", done.stderr)
                self.assertTrue((self.folder / "out/map.pgm").exists())

    def test_text_logs_with_bad_scans_name_the_line(self):
        good = support.room_lines(20)
        bad = {
            "nan.log": [good[0], support.carmen_scan(1000.2, ["nan"] + ["1.0"] * 180, 2, 2, 0), *good[2:]],
            "short.log": [good[0], support.carmen_scan(1000.2, [], 2, 2, 0), *good[2:]],
            "words.log": [good[0], good[1].replace(" 2.0", " two", 1), *good[2:]],
            "missing.log": [good[0], " ".join(good[1].split()[:40]), *good[2:]],
        }
        for name, lines in bad.items():
            self.write(name, "\n".join(lines) + "\n")
            self.refuse(name, "2")

    def test_time_that_runs_backwards_is_refused(self):
        lines = support.room_lines(40)
        self.write("back.log", "\n".join(lines[:20] + lines[35:] + lines[20:35]) + "\n")
        self.refuse("back.log", "back")

    def test_a_log_without_a_laser_is_refused_by_slam_and_run(self):
        self.write("wheels.log", "\n".join(f"ODOM {0.1 * i} 0 0 0.5 0 0 {1000 + 0.1 * i} robot {1000 + 0.1 * i}" for i in range(50)) + "\n")
        self.assert_says(self.mapweave("slam", "wheels.log", "--out", "out", code=BAD_INPUT), "wheels.log", "laser")
        config = self.configuration([("alpha", "wheels.log")])
        self.assert_says(self.mapweave("run", config, "--out", "out", code=BAD_INPUT), "wheels.log", "laser")
        self.assert_nothing_left("out")

    def test_empty_and_absent_logs_are_refused(self):
        self.write("empty.rawlog", "")
        self.refuse("empty.rawlog", "empty")
        self.write_bytes("hollow.rawlog", gzip.compress(b""))
        self.refuse("hollow.rawlog")
        self.refuse("absent.rawlog")
        self.write("letter.txt", "Dear robot,\nwhere are you?\n")
        self.refuse("letter.txt", "rawlog")


class KeepGoing(support.Scenario):
    def setUp(self):
        super().setUp()
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--overlap", "10", "--out", "logs")
        whole = (self.folder / "logs/robot1.rawlog").read_bytes()
        (self.folder / "cut.rawlog").write_bytes(whole[:len(whole) // 2])
        self.config = self.configuration([("alpha", "logs/robot0.rawlog"), ("beta", "cut.rawlog")])

    def test_without_it_one_bad_log_ends_the_run_and_nothing_is_written(self):
        self.assert_says(self.mapweave("run", self.config, "--out", "out", code=BAD_INPUT), "cut.rawlog", "byte")
        self.assert_nothing_left("out")

    def test_with_it_the_robot_s_stream_ends_there_and_the_others_finish(self):
        done = self.mapweave("run", self.config, "--out", "out", "--keep-going", code=BAD_INPUT)
        self.assertIn("cut.rawlog", done.stdout + done.stderr)
        robots = {robot["id"]: robot for robot in self.read_json("out/summary.json")["robots"]}
        alone = self.mapweave("run", self.configuration([("alpha", "logs/robot0.rawlog")], "one.yaml"), "--out", "alone", code=(DONE, APART))
        self.assertIsNotNone(alone)
        self.assertEqual(robots["alpha"]["scans"], self.read_json("alone/summary.json")["robots"][0]["scans"])
        self.assertGreater(robots["beta"]["scans"], 0)
        self.assertEqual((self.folder / "out/robots/alpha/map.pgm").read_bytes(), (self.folder / "alone/robots/alpha/map.pgm").read_bytes())


if __name__ == "__main__":
    support.main()
