"""Bags of ROS 1 as recordings: slam, run, split, convert and inspect take them as they take a rawlog."""
import json
import pathlib
import shutil
import subprocess
import unittest

import ros1_bags
import support
from support import BAD_INPUT

ROS_PYTHON = "/usr/bin/python3"   # which Debian's python3-rosbag is for


class Bags(support.Scenario):
    def written(self, name, messages):
        path = self.folder / name
        path.write_bytes(ros1_bags.bag(messages))
        return path

    def poses(self, out):
        lines = (out / "trajectory.tum").read_text().splitlines()
        return [tuple(map(float, line.split())) for line in lines if not line.startswith("#")]

    def slam(self, log, *flags):
        out = self.folder / f"out-{log.name}"
        self.mapweave("slam", log, "--out", out, *flags)
        return out

    def test_a_bag_maps_as_the_rawlog_that_is_made_of_it(self):
        bag = self.written("alpha.bag", ros1_bags.drive())
        self.mapweave("convert", bag, self.folder / "alpha.rawlog")
        one, other = self.slam(bag), self.slam(self.folder / "alpha.rawlog")
        for name in ("map.pgm", "trajectory.tum"):
            self.assertEqual((one / name).read_bytes(), (other / name).read_bytes(), name)

    def test_a_laser_that_hangs_upside_down_makes_the_same_map(self):
        upright = self.poses(self.slam(self.written("upright.bag", ros1_bags.drive())))
        upside_down = self.poses(self.slam(self.written("hanging.bag", ros1_bags.drive(upside_down=True))))
        self.assertEqual(len(upright), len(upside_down))
        self.assertLess(max(abs(a - b) for one, other in zip(upright, upside_down) for a, b in zip(one[1:4], other[1:4])), 0.05)

    def test_scans_bent_by_turns_are_corrected_by_their_time_increment(self):
        error = dict.fromkeys(("straight", "bent", "as it is"), 0.0)
        for seed in (1, 2):
            for name, sweep_s, flags in (("straight", 0.0, ()), ("bent", 0.1, ()), ("as it is", 0.1, ("--set", "laser.scan.sweep=none", "--set", "laser.graph.sweep.estimate=false"))):
                messages, truth = ros1_bags.turning_drive(sweep_s, seed)
                out = self.slam(self.written(f"{name}-{seed}.bag", messages), *flags)
                done = self.mapweave("evaluate", "trajectory", "--estimate", out / "trajectory.tum", "--reference", self.write("truth.tum", truth), "--align", "se2", "--json")
                error[name] += json.loads(done.stdout)["ate_translation_rmse_m"] / 2
        self.assertLess(error["straight"], 0.01)
        self.assertLess(error["bent"], 1.1 * error["straight"], error)
        self.assertGreater(error["as it is"], 0.1, "the scans are bent")

    def test_inspect_lists_topics_and_frames(self):
        shown = json.loads(self.mapweave("inspect", self.written("alpha.bag", ros1_bags.drive()), "--json").stdout)
        topics = {topic["topic"]: topic for topic in shown["topics"]}
        self.assertEqual((topics["/scan"]["type"], topics["/scan"]["count"], topics["/scan"]["frames"]), ("sensor_msgs/LaserScan", 30, ["laser"]))
        self.assertAlmostEqual(topics["/odom"]["rate_hz"], 5.0, 3)
        self.assertEqual(topics["/tf_static"]["frames"], ["base_link -> laser"])
        self.assertEqual(shown["scans"], 30)

    def test_two_lasers_need_a_choice_and_inspect_still_shows_them(self):
        messages = ros1_bags.drive() + [ros1_bags.scan(1000.0, [1.0, 2.0], "/rear/scan")]
        bag = self.written("two.bag", messages)
        refused = self.mapweave("slam", bag, "--out", self.folder / "out", code=BAD_INPUT)
        self.assertIn("2 topics of a laser", refused.stderr)
        self.assertIn("reading.topics=[", refused.stderr)
        self.assertIn("2 topics of a laser", json.loads(self.mapweave("inspect", bag, "--json").stdout)["not_read_as_it_is"])
        self.slam(bag, "--set", "reading.topics=[/scan, /odom]")

    def test_robots_of_one_bag_become_logs_by_their_namespaces(self):
        bag = self.written("team.bag", ros1_bags.drive(robot="tb3_0") + ros1_bags.drive(robot="tb3_1", shift=1.0))
        self.assertIn("--by-namespace", self.mapweave("slam", bag, "--out", self.folder / "out", code=BAD_INPUT).stderr)
        parts = self.folder / "parts"
        self.mapweave("split", bag, "--by-namespace", "--out", parts)
        self.assertEqual(sorted(path.name for path in parts.glob("*.rawlog")), ["tb3_0.rawlog", "tb3_1.rawlog"])
        self.mapweave("run", parts / "run.yaml", "--out", self.folder / "team")
        configuration = self.folder / "run.yaml"
        configuration.write_text("robots:\n" + "".join(f"  - {{id: r{i}, log: team.bag, reading: {{robot_namespace: tb3_{i}}}}}\n" for i in range(2)))
        self.mapweave("run", configuration, "--out", self.folder / "again")
        self.assertEqual((self.folder / "team/team/map.pgm").read_bytes(), (self.folder / "again/team/map.pgm").read_bytes())

    def test_a_missing_transform_is_named_with_what_helps(self):
        messages = [message for message in ros1_bags.drive() if message[0] != "/tf_static"]
        messages.insert(0, ros1_bags.transforms(1000.0, [("base_link", "camera", 0.0, 0.0, 0.0, 0.0, 0.0)]))
        bag = self.written("lost.bag", messages)
        refused = self.mapweave("slam", bag, "--out", self.folder / "out", code=BAD_INPUT)
        self.assertIn("no transform leads from 'base_link' to 'laser'", refused.stderr)
        self.slam(bag, "--set", "reading.use_tf=false", "--set", "reading.laser_x_m=0.2")

    def test_a_bag_that_is_cut_short_is_mapped_as_far_as_it_goes(self):
        bag = self.written("cut.bag", ros1_bags.drive())
        bag.write_bytes(bag.read_bytes()[:-8000])
        self.assert_says(self.mapweave("slam", bag, "--out", self.folder / "refused", code=BAD_INPUT), "cut short", "--keep-going")
        self.mapweave("slam", bag, "--out", self.folder / "kept", "--keep-going", code=BAD_INPUT)
        poses = self.poses(self.folder / "kept")
        self.assertGreater(len(poses), 15)
        self.assertLess(len(poses), 30)

    def parts(self, messages, count=3):
        """A folder of a bag that was split."""
        folder = self.folder / "office"
        folder.mkdir(exist_ok=True)
        for i in range(count):
            (folder / f"office_{i}.bag").write_bytes(ros1_bags.bag(messages[i * len(messages) // count:(i + 1) * len(messages) // count]))
        return folder

    def assert_same_results(self, one, other):
        for name in ("map.pgm", "trajectory.tum"):
            self.assertEqual((one / name).read_bytes(), (other / name).read_bytes(), name)

    def test_a_bag_that_was_split_maps_as_the_whole_one(self):
        whole = self.slam(self.written("whole.bag", ros1_bags.drive()))
        folder = self.parts(ros1_bags.drive())
        self.assert_same_results(whole, self.slam(folder))
        shown = json.loads(self.mapweave("inspect", folder, "--json").stdout)
        self.assertEqual((shown["scans"], {topic["topic"]: topic["count"] for topic in shown["topics"]}), (30, {"/odom": 30, "/scan": 30, "/tf_static": 1}))
        self.mapweave("convert", folder, self.folder / "office.rawlog")
        self.assert_same_results(whole, self.slam(self.folder / "office.rawlog"))
        self.mapweave("split", folder, "--robots", "2", "--out", self.folder / "halves")
        self.assertEqual(len(list((self.folder / "halves").glob("*.rawlog"))), 2)
        configuration = self.write("run.yaml", "robots:\n  - {id: one, log: office}\n")
        self.mapweave("run", configuration, "--out", self.folder / "run")

    def test_a_missing_part_is_named_and_what_precedes_it_can_be_mapped(self):
        folder = self.parts(ros1_bags.drive())
        (folder / "office_1.bag").unlink()
        refused = self.mapweave("slam", folder, "--out", self.folder / "refused", code=BAD_INPUT)
        self.assert_says(refused, "part 1 of the recording is missing: 'office_2.bag' follows 'office_0.bag'", "--keep-going")
        self.mapweave("slam", folder, "--out", self.folder / "kept", "--keep-going", code=BAD_INPUT)
        self.assertEqual(len(self.poses(self.folder / "kept")), 9)   # the tenth scan is in part 1

    @unittest.skipUnless(shutil.which("rosbag") and pathlib.Path(ROS_PYTHON).exists(), "needs Debian's rosbag")
    def test_parts_that_ros_1_s_own_rosbag_wrote_are_one_recording(self):
        whole = self.slam(self.written("whole.bag", ros1_bags.drive()))
        messages = json.dumps([(topic, kind, stamp, data.hex()) for topic, kind, stamp, data in ros1_bags.drive()])
        for compression in ("none", "bz2", "lz4"):
            folder = self.folder / compression
            folder.mkdir()
            done = subprocess.run([ROS_PYTHON, pathlib.Path(__file__).with_name("split_by_rosbag.py"), "4", folder / "office", compression],
                                  input=messages, capture_output=True, text=True, check=False, timeout=120)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assert_same_results(whole, self.slam(folder))

    def test_a_bag_of_no_bytes_or_of_no_sensors_is_refused(self):
        self.assert_says(self.mapweave("slam", self.write("empty.bag", ""), "--out", "out", code=BAD_INPUT), "is empty")
        self.assert_says(self.mapweave("slam", self.written("talk.bag", [("/chatter", "std_msgs/String", 1.0, bytes(4))]), "--out", "out", code=BAD_INPUT), "/chatter (std_msgs/String)")


if __name__ == "__main__":
    support.main()
