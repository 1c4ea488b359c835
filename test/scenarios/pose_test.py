"""A robot's pose as it comes, from laser, cameras and wheels: robot.tum."""
import csv
import json
import unittest

import support

WORLD = """
seed: 7
buildings: [{{kind: apartment, furniture: {{round: 0.3}}, apartment: {{width_m: 8, height_m: 7}}}}]
look: {{posters_per_10_m: 4}}
laser: {{rays: 121, scans_per_second: 5, max_range_m: 8}}
{more}
robots: [{{id: alpha, length_m: {length_m}}}]
"""
CAMERA = ("cameras: [{id: eye, kind: rgbd, width: 320, height: 240, fx: 262, fy: 262, frames_per_second: 10, "
          "dark_from_s: 6, dark_for_s: 5}]")


class Poses(support.Scenario):
    def simulated(self, more, length_m):
        self.write("world.yaml", WORLD.format(more=more, length_m=length_m))
        self.mapweave("simulate", "world.yaml", "--force", "--out", "world")
        return self.folder / "world/alpha.rawlog"

    def summary(self, out):
        return self.read_json(f"{out}/summary.json")["robots"][0]["pose"]

    def lines(self, out):
        """Of robot.tum, with who gave each; stamps rise."""
        poses = [[float(value) for value in line.split()] for line in (self.folder / out / "robot.tum").read_text().splitlines()]
        with open(self.folder / out / "robot.sources.csv", encoding="utf-8") as file:
            sources = list(csv.DictReader(file))
        self.assertEqual([f"{pose[0]:.6f}" for pose in poses], [source["stamp_s"] for source in sources])
        self.assertTrue(all(a[0] < b[0] for a, b in zip(poses, poses[1:])))
        return poses, sources

    def error(self, trajectory):
        done = self.mapweave("evaluate", "trajectory", self.folder / trajectory, self.folder / "world/alpha.truth.tum", "--align", "se2", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def test_wheels_fill_in_between_scans(self):
        log = self.simulated("", 12)
        self.mapweave("slam", log, "--out", "alpha")
        poses, sources = self.lines("alpha")
        self.assertEqual({source["source"] for source in sources}, {"laser", "wheels"})
        self.assertEqual({source["leader"] for source in sources}, {"laser"})
        self.assertGreater(len(poses), 1.9 * len((self.folder / "alpha/trajectory.tum").read_text().splitlines()))
        self.assertLess(self.error("alpha/robot.tum"), 0.06)
        self.assertEqual(self.summary("alpha")["failovers"], 0)
        seen = json.loads(self.mapweave("inspect", "alpha/robot.sources.csv", "--json").stdout)
        self.assertEqual((seen["kind"], seen["poses"]), ("sources of a robot's poses", len(poses)))
        self.mapweave("slam", log, "--set", "output.tum=false", "--out", "none")
        self.assertFalse((self.folder / "none/robot.tum").exists())
        self.mapweave("slam", log, "--engine", "icp", "--out", "icp")
        self.assertFalse((self.folder / "icp/robot.tum").exists())
        self.assertIn("no robot.tum", " ".join(self.read_json("icp/summary.json")["notes"]))
        self.mapweave("run", "world/run.yaml", "--out", "team")
        self.assertEqual((self.folder / "team/robots/alpha/robot.tum").read_bytes(), (self.folder / "alpha/robot.tum").read_bytes())

    def test_a_camera_that_goes_dark_leaves_no_gap(self):
        log = self.simulated(CAMERA, 12)
        done = self.mapweave("slam", log, "--sensor", "rgbd", "--out", "alpha", code=(support.DONE, support.APART))
        poses, sources = self.lines("alpha")
        self.assertLess(max(b[0] - a[0] for a, b in zip(poses, poses[1:])), 0.25)
        begin = poses[0][0]
        dark = [source["leader"] for pose, source in zip(poses, sources) if begin + 6.7 < pose[0] < begin + 10.8]
        self.assertGreater(len(dark), 10)
        self.assertEqual(set(dark), {"wheels"})
        self.assertIn("fails_over", {source["event"] for source in sources})
        pose = self.summary("alpha")
        self.assertGreater(pose["longest_on_wheels_seconds"], 4.5)
        self.assertGreaterEqual(pose["failovers"], 1)
        self.assertAlmostEqual(sum(source["share"] for source in pose["sources"]), 1.0)
        self.assertIn("on wheels alone", done.stdout)
        self.assertLess(self.error("alpha/robot.tum"), 0.15)

    def test_another_sensor_takes_over_and_gives_back(self):
        log = self.simulated(CAMERA, 12)
        self.mapweave("slam", log, "--sensor", "all", "--set", "pose.first=cameras", "--out", "alpha")
        poses, sources = self.lines("alpha")
        begin = poses[0][0]
        dark = {source["leader"] for pose, source in zip(poses, sources) if begin + 6.7 < pose[0] < begin + 10.8}
        self.assertEqual(dark, {"laser"})
        self.assertEqual({source["leader"] for source in sources}, {"laser", "eye"})
        self.assertLess(self.error("alpha/robot.tum"), 0.1)


if __name__ == "__main__":
    unittest.main()
