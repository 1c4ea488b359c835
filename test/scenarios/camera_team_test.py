"""run with robots that carry a camera and a laser: one map of both, the same bytes for any number of threads."""
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

import support


class CameraTeam(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        subprocess.run([support.PROGRAM, "simulate", support.ROOT / "configs/worlds/camera_team.yaml", "--set", "robots.0.length_m=11",
                        "--set", "robots.1.length_m=11", "--out", cls.world], env=support.environment(), capture_output=True, check=True)

    def error(self, out):
        done = self.mapweave("evaluate", "trajectory", "--estimate", self.folder / out, "--reference", self.world / "beta.truth.tum",
                             "--align", "se3", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def test_cameras_and_lasers_give_one_map(self):
        for threads in (1, 2):
            self.mapweave("run", self.world / "run.yaml", "--set", "sensor=all", "--threads", threads, "--out", f"team{threads}")
        merges = json.loads((self.folder / "team1/merges.json").read_text())
        cloud = [merge for merge in merges if merge["tier"] == "cloud"]
        self.assertTrue(any(merge["accepted"] and "vision" in merge["kind"] for merge in cloud), cloud)
        for name in ("team/map.color.png", "team/map.pgm", "team/map.pcd", "robots/beta/cameras/map.png", "robots/beta/map.png"):
            self.assertTrue((self.folder / "team1" / name).exists(), name)
        for name in ("team/trajectories/beta.tum", "team/map.mwdb", "team/map.pcd", "robots/beta/trajectory.tum"):
            self.assertEqual((self.folder / "team1" / name).read_bytes(), (self.folder / "team2" / name).read_bytes(), name)
        self.assertLess(self.error("team1/team/trajectories/beta.tum"), 0.05)

    def test_cameras_alone_are_joined(self):
        self.mapweave("run", self.world / "run.yaml", "--set", "sensor=rgbd", "--out", "seen")
        merges = json.loads((self.folder / "seen/merges.json").read_text())
        self.assertTrue(any(merge["accepted"] and merge["kind"] == "vision" for merge in merges), merges)
        self.assertLess(self.error("seen/team/trajectories/beta.tum"), 0.08)

    def test_a_team_maps_and_merges_with_a_vocabulary_of_its_own(self):
        for name, shape in (("words/own.txt.gz", (4, 3)), ("words/other.txt.gz", (3, 2))):
            (self.folder / name).parent.mkdir(exist_ok=True)
            self.mapweave("vocabulary", "train", self.world / "alpha.rawlog", "--branching", shape[0], "--levels", shape[1], "--out", name)
        robots = "".join(f"  - {{log: {json.dumps(str(self.world / log))}}}\n" for log in ("alpha.rawlog", "beta.rawlog"))
        self.write("words/team.yaml", f"robots:\n{robots}sensor: rgbd\nserver: {{share: full}}\nvisual: {{vocabulary: own.txt.gz}}\n")
        # Apart: with so few words a camera that was lost may come to no place that it knows; its second map stays apart.
        self.mapweave("run", "words/team.yaml", "--out", "team", code=(support.DONE, support.APART))
        hashed = json.loads(self.mapweave("vocabulary", "info", "words/own.txt.gz", "--json").stdout)["hash"]
        inputs = [pathlib.Path(entry["path"]).name for entry in self.read_json("team/manifest.json")["inputs"]]
        self.assertIn("own.txt.gz", inputs)
        self.assertTrue(any(merge["accepted"] for merge in self.read_json("team/merges.json")))

        # Maps hold no words: they may be merged with any vocabulary, and a note says that it is another one.
        self.mapweave("merge", "team", "--out", "shipped", code=(support.DONE, support.APART))
        notes = [note for note in self.read_json("shipped/summary.json")["notes"] if "vocabulary" in note]
        self.assertEqual(len(notes), 1, "said once, whatever the number of stores")
        self.assertIn(hashed, notes[0])
        for name, count in (("own", 0), ("other", 1)):
            self.mapweave("merge", "team", "--set", f"visual.vocabulary=words/{name}.txt.gz", "--out", name, code=(support.DONE, support.APART))
            notes = self.read_json(f"{name}/summary.json").get("notes", [])
            self.assertEqual(len([note for note in notes if "vocabulary" in note]), count, notes)
        judged = [sorted(map(str, self.read_json(f"{name}/merges.json"))) for name in ("own", "other")]
        self.assertNotEqual(*judged)

    def test_a_vocabulary_that_is_none_is_refused(self):
        self.write("bad.txt", "10 4 0 0\n0 0 1 2 3\n")
        done = self.mapweave("run", self.world / "run.yaml", "--set", "visual.vocabulary=bad.txt", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "bad.txt:2")
        self.write("team.yaml", f"robots: [{{id: alpha, log: {json.dumps(str(self.world / 'alpha.rawlog'))}}}]\nvisual: {{vocabulary: none.txt}}\n")
        done = self.mapweave("run", "team.yaml", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "there is no vocabulary", "none.txt", "team.yaml")
        self.assert_nothing_left("no")

    def team_error(self, out):
        """One alignment for both robots: beta's stamps are moved behind alpha's."""
        def together(name, paths):
            lines = []
            for number, path in enumerate(paths):
                for line in path.read_text().splitlines():
                    if line and line[0] != "#":
                        stamp, pose = line.split(" ", 1)
                        lines.append(f"{float(stamp) + 10000.0 * number:.6f} {pose}\n")
            return self.write(name, "".join(lines))

        estimate = together(f"{out}.tum", [self.folder / out / f"team/trajectories/{robot}.tum" for robot in ("alpha", "beta")])
        truth = together(f"{out}.truth.tum", [self.world / f"{robot}.truth.tum" for robot in ("alpha", "beta")])
        done = self.mapweave("evaluate", "trajectory", "--estimate", estimate, "--reference", truth, "--align", "se3", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def test_two_edges_are_as_good_as_one(self):
        two = (self.world / "run.yaml").read_text()
        logs = [(robot, self.world / f"{robot}.rawlog") for robot in ("alpha", "beta")]
        self.assertEqual(len(set(re.findall(r"edge: (\S+?)[,}\s]", two))), 2, two)
        self.mapweave("run", self.world / "run.yaml", "--set", "sensor=rgbd", "--out", "two")
        self.mapweave("run", self.configuration([(*log, "one") for log in logs]), "--set", "sensor=rgbd", "--out", "one")
        for out in ("one", "two"):
            self.assertTrue((self.folder / out / "team/map.mwdb").exists(), out)
        self.assertLess(self.team_error("two"), 1.05 * self.team_error("one"))

    def test_cameras_share_while_they_map_within_their_wires(self):
        one_edge = self.configuration([(robot, self.world / f"{robot}.rawlog", "one") for robot in ("alpha", "beta")])
        share = ("--set", "sensor=rgbd", "--set", "server.share=view", "--set", "uplink.most_bytes_per_s=20000")
        for threads in (1, 2):
            self.mapweave("run", one_edge, *share, "--threads", threads, "--out", f"shared{threads}")
        for name in ("team/trajectories/beta.tum", "team/map.mwdb", "robots/alpha/trajectory.tum", "robots/beta/trajectory.tum"):
            self.assertEqual((self.folder / "shared1" / name).read_bytes(), (self.folder / "shared2" / name).read_bytes(), name)
        self.assertLess(self.team_error("shared1"), 0.05)
        robots = self.read_json("shared1/summary.json")["robots"]
        for robot in robots:
            seconds, [camera] = robot["log_seconds"], robot["cameras"]
            self.assertGreater(camera["sent_bytes"], 1000.0 * seconds)
            self.assertLess(camera["sent_bytes"], 1.2 * 20000.0 * seconds)
            # Second by second: all of it, in the order of time, while any robot drove: what waited for the wire is sent after its own drive.
            moments, sent, received = zip(*camera["traffic"])
            self.assertEqual((sum(sent), sum(received)), (camera["sent_bytes"], camera["heard_bytes"]))
            self.assertEqual(list(moments), sorted(set(moments)))
            self.assertLess(moments[-1], max(one["log_seconds"] for one in robots) + 1.0)
            self.assertGreater(len(moments), 0.5 * seconds)
        self.assertGreater(sum(robot["cameras"][0]["heard_bytes"] for robot in robots), 0)

    def test_cameras_keep_the_map_of_the_whole_team(self):
        one_edge = self.configuration([(robot, self.world / f"{robot}.rawlog", "one") for robot in ("alpha", "beta")])
        self.mapweave("run", one_edge, "--set", "sensor=rgbd", "--set", "server.share=full", "--out", "full")
        for threads in (1, 2):
            self.mapweave("run", one_edge, "--set", "sensor=rgbd", "--set", "server.share=global", "--threads", threads, "--out", f"global{threads}")
        for name in ("team/trajectories/beta.tum", "team/map.mwdb", "robots/alpha/trajectory.tum", "robots/beta/trajectory.tum"):
            self.assertEqual((self.folder / "global1" / name).read_bytes(), (self.folder / "global2" / name).read_bytes(), name)
        self.assertLess(self.team_error("global1"), 1.05 * self.team_error("full"))
        cameras = [camera for robot in self.read_json("global1/summary.json")["robots"] for camera in robot["cameras"]]
        self.assertGreater(min(camera["shared_keyframes"]["kept"] for camera in cameras), 5)
        self.assertTrue(all(camera["shared_keyframes"]["dropped"] == 0 for camera in cameras))
        for robot in self.read_json("full/summary.json")["robots"]:
            self.assertNotIn("shared_keyframes", robot["cameras"][0])


if __name__ == "__main__":
    unittest.main()
