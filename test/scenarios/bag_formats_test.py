"""Recordings of ROS 2, written by PyPI's rosbags and mcap: every verb gives what the ROS 1 bag of the same messages gives."""
import json
import pickle
import subprocess

import ros1_bags
import support
from support import BAD_INPUT

WRITER = support.ROOT / "scripts/evaluation/write_bag.py"


class Formats(support.Scenario):
    def ros1(self, name, messages):
        path = self.folder / name
        path.write_bytes(ros1_bags.bag(messages))
        return path

    def written(self, messages, names, copies=1):
        """Recordings of the messages, by name and kind of write_bag.py; of `db3-alone` the file without its folder."""
        source = self.folder / "messages"
        source.write_bytes(pickle.dumps([(topic, kind, round(stamp * 1e9), data) for topic, kind, stamp, data in messages]))
        outs = {name: self.folder / (name.removesuffix(".db3") if kind == "db3-alone" else name) for name, kind in names.items()}
        command = [support.ros_interpreter(), "-B", WRITER, source, *(f"{kind.removesuffix('-alone')}:{copies}:{outs[name]}" for name, kind in names.items())]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60 * support.PATIENCE, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        for name, kind in names.items():
            if kind == "db3-alone":
                (outs[name] / name).replace(self.folder / name)
        return [self.folder / name for name in names]

    def recordings(self, messages):
        return self.written(messages, {"plain.mcap": "mcap", "packed.mcap": "mcap-lz4", "alone.db3": "db3-alone", "folder": "db3-file", "packed-messages": "db3-message"})

    def inspect(self, log):
        return json.loads(self.mapweave("inspect", log, "--json").stdout)

    def slam(self, log, *flags, **expected):
        out = self.folder / f"map-{log.name}"
        self.mapweave("slam", log, "--robot", "alpha", "--out", out, *flags, **expected)
        return out

    def parts(self, log, *flags):
        """Bytes of the logs that a log is split into, by their numbers or namespaces."""
        out = self.folder / f"parts-{log.name}"
        self.mapweave("split", log, *flags, "--out", out)
        return {path.stem.removeprefix(log.stem): path.read_bytes() for path in out.glob("*.rawlog")}

    def team(self, log):
        """The map of a team whose robots are in one recording."""
        out = self.folder / f"team-{log.name}"
        robots = "".join(f"  - {{id: r{i}, log: {log.name}, reading: {{robot_namespace: tb3_{i}}}}}\n" for i in range(2))
        self.mapweave("run", self.write("team.yaml", "robots:\n" + robots), "--out", out)
        return out / "team"

    def assert_same(self, one, other, *names):
        for name in names:
            self.assertEqual((one / name).read_bytes(), (other / name).read_bytes(), name)

    def test_slam_split_convert_and_inspect_take_all_alike(self):
        recordings = self.recordings(ros1_bags.drive())
        bag = self.ros1("ros1.bag", ros1_bags.drive())
        rawlog = self.folder / "ros1.rawlog"
        self.mapweave("convert", bag, rawlog)
        shown, map_, halves = self.inspect(bag), self.slam(bag), self.parts(bag, "--robots", "2")
        self.assertEqual((shown["scans"], len(halves)), (30, 2))
        for recording in recordings:
            with self.subTest(recording.name):
                self.assertEqual(self.inspect(recording) | {"format": ""}, shown | {"format": ""})
                converted = self.folder / f"{recording.name}.rawlog"
                self.mapweave("convert", recording, converted)
                self.assertEqual(converted.read_bytes(), rawlog.read_bytes())
                self.assert_same(self.slam(recording), map_, "map.pgm", "trajectory.tum")
                self.assertEqual(self.parts(recording, "--robots", "2"), halves)

    def test_robots_of_one_recording_are_a_team_and_become_logs_by_their_namespaces(self):
        messages = sorted(ros1_bags.drive(robot="tb3_0") + ros1_bags.drive(robot="tb3_1", shift=1.0), key=lambda message: message[2])
        bag = self.ros1("ros1.bag", messages)
        logs, team = self.parts(bag, "--by-namespace"), self.team(bag)
        self.assertEqual(set(logs), {"tb3_0", "tb3_1"})
        for recording in self.recordings(messages):
            with self.subTest(recording.name):
                self.assertEqual(self.parts(recording, "--by-namespace"), logs)
                self.assert_same(self.team(recording), team, "map.pgm", "trajectories/r0.tum", "trajectories/r1.tum")
                self.assert_says(self.mapweave("slam", recording, "--out", "refused", code=BAD_INPUT), "--by-namespace")

    def test_inspect_shows_the_longest_gap_of_each_topic(self):
        messages = [message for message in ros1_bags.drive() if message[0] != "/scan" or not 1001.9 < message[2] < 1002.9]   # five scans are missing
        for recording in [self.ros1("ros1.bag", messages), *self.recordings(messages)]:
            with self.subTest(recording.name):
                topics = {topic["topic"]: topic for topic in self.inspect(recording)["topics"]}
                for name, count, gap in (("/scan", 25, 1.2), ("/odom", 30, 0.2), ("/tf_static", 1, 0.0)):
                    self.assertEqual(topics[name]["count"], count)
                    self.assertAlmostEqual(topics[name]["longest_gap_s"], gap, 6)

    def test_an_organised_cloud_gives_what_the_depth_image_gives(self):
        image = self.ros1("image.bag", ros1_bags.depth_drive(as_cloud=False))
        expected = self.folder / "image.rawlog"
        self.mapweave("convert", image, expected)
        sensors = self.inspect(image)["sensors"]
        self.assertEqual([(sensor["label"], sensor["class"], sensor["count"]) for sensor in sensors], [("camera", "CObservation3DRangeScan", 5)])
        messages = ros1_bags.depth_drive(as_cloud=True)
        for recording in [self.ros1("cloud.bag", messages), *self.recordings(messages)]:
            with self.subTest(recording.name):
                shown = self.inspect(recording)
                self.assertEqual(shown["sensors"], sensors)
                clouds = [topic["points"] for topic in shown["topics"] if "points" in topic]
                self.assertEqual(clouds, [{"width": 32, "height": 24, "organised": True, "fields": ["x", "y", "z"]}])
                converted = self.folder / f"{recording.name}.rawlog"
                self.mapweave("convert", recording, converted)
                self.assertEqual(converted.read_bytes(), expected.read_bytes())

    def stamps(self, out):
        return [line.split()[0] for line in (out / "trajectory.tum").read_text().splitlines() if not line.startswith("#")]

    def test_a_cut_recording_is_mapped_as_far_as_it_goes(self):
        whole = None
        kinds = {f"{kind}.mcap": kind for kind in ("mcap", "mcap-zstd", "mcap-lz4")} | {"alone.db3": "db3-alone", "folder": "db3-file"}
        for recording in self.written(ros1_bags.drive(), kinds, copies=30):   # more than a chunk
            with self.subTest(recording.name):
                whole = whole or self.stamps(self.slam(recording))
                part, = recording.glob("*.db3.zstd") if recording.is_dir() else [recording]
                part.write_bytes(part.read_bytes()[:int(0.8 * part.stat().st_size)])
                place = f"{part.name} at message" if part.suffix == ".db3" else f"{part.name} at byte"
                self.assert_says(self.mapweave("slam", recording, "--out", "refused", code=BAD_INPUT), place, "--keep-going")
                self.assert_nothing_left("refused")
                kept = self.stamps(self.slam(recording, "--keep-going", "--force", code=BAD_INPUT))
                self.assertEqual(kept, whole[:len(kept)])
                self.assertGreater(len(kept), len(whole) / 3)   # zstd packs what comes later better
                self.assertLess(len(kept), len(whole))

    def test_recordings_of_no_bytes_are_refused(self):
        for name in ("empty.mcap", "empty.db3", "empty.bag"):
            self.write(name, "")
            for verb in (("slam", name, "--out", "out"), ("inspect", name), ("convert", name, "out.rawlog"), ("split", name, "--robots", "2", "--out", "out")):
                self.assert_says(self.mapweave(*verb, code=BAD_INPUT), name, "is empty")
            self.assert_nothing_left("out", "out.rawlog")


if __name__ == "__main__":
    support.main()
