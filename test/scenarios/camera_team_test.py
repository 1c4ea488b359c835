"""run with robots that carry a camera and a laser: one map of both, the same bytes for any number of threads."""
import json
import pathlib
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
        for name in ("team/trajectory.tum", "team/map.mwdb", "team/map.pcd", "robots/beta/trajectory.tum"):
            self.assertEqual((self.folder / "team1" / name).read_bytes(), (self.folder / "team2" / name).read_bytes(), name)
        self.assertLess(self.error("team1/team/trajectories/beta.tum"), 0.05)

    def test_cameras_alone_are_joined(self):
        self.mapweave("run", self.world / "run.yaml", "--set", "sensor=rgbd", "--out", "seen")
        merges = json.loads((self.folder / "seen/merges.json").read_text())
        self.assertTrue(any(merge["accepted"] and merge["kind"] == "vision" for merge in merges), merges)
        self.assertLess(self.error("seen/team/trajectories/beta.tum"), 0.08)


if __name__ == "__main__":
    unittest.main()
