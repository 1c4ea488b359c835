"""slam with cameras, from simulated pictures to trajectories, landmarks and pictures for people."""
import json
import math
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest

import support


def poses(path):
    return [[float(value) for value in line.split()] for line in path.read_text().splitlines()]


def ply_points(path):
    header, data = path.read_bytes().split(b"end_header\n", 1)
    points = list(struct.iter_unpack("<3f3B", data))
    assert f"element vertex {len(points)}".encode() in header
    return points


class Cameras(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        subprocess.run([support.PROGRAM, "simulate", support.ROOT / "configs/worlds/camera_tiny.yaml", "--set", "logs.layout=both",
                        "--out", cls.world], env=support.environment(), capture_output=True, check=True)

    def error(self, trajectory, truth):
        done = self.mapweave("evaluate", "trajectory", "--estimate", trajectory, "--reference", truth, "--align", "se3", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def test_a_depth_camera_and_a_pair_are_mapped_in_one_frame_of_the_robot(self):
        world = self.world
        done = self.mapweave("slam", world / "alpha.rawlog", "--sensor", "rgbd", "--out", "depth")
        out = self.folder / "depth"
        for name in ("trajectory.tum", "keyframes.tum", "map.pcd", "map.png", "frames.png", "map.mwdb", "summary.json", "manifest.json"):
            self.assertTrue((out / name).exists(), name)
        camera = json.loads((out / "summary.json").read_text())["robots"][0]["cameras"][0]
        self.assertEqual((camera["label"], camera["kind"], camera["lost"]), ("rgbd", "rgbd", 0))
        self.assertEqual(len(poses(out / "trajectory.tum")), camera["tracked"])
        self.assertIn("tracked", done.stdout)
        self.assertLess(self.error(out / "trajectory.tum", world / "alpha.truth.tum"), 0.03)
        first = poses(out / "trajectory.tum")[0]
        self.assertLess(math.dist(first[1:4], (0, 0, 0)), 0.02, "the map begins where the robot stood")

        self.mapweave("slam", world / "alpha.rawlog", "--sensor", "stereo", "--out", "pair")
        self.assertLess(self.error(self.folder / "pair/trajectory.tum", world / "alpha.truth.tum"), 0.06)

    def test_what_depth_cameras_saw_is_written_where_it_is_asked_for(self):
        world = self.world
        team = f"robots:\n  - {{id: alpha, log: {json.dumps(str(world / 'alpha_rgbd'))}}}\noutput: {{ply: true, octomap: true}}\n"
        self.write("team.yaml", team)
        self.mapweave("run", "team.yaml", "--threads", 2, "--out", "team")
        self.mapweave("slam", world / "alpha_rgbd", "--set", "output.ply=true", "--set", "output.octomap=true", "--threads", 1, "--out", "one")
        self.assertFalse((self.folder / "team/robots/alpha/map.ply").exists(), "the team's folder holds it")
        for name in ("map.ply", "map.dense.pcd", "map.bt", "map.ot"):
            self.assertEqual((self.folder / "team/team" / name).read_bytes(), (self.folder / "one" / name).read_bytes(), name)
        points = ply_points(self.folder / "one/map.ply")
        self.assertGreater(len(points), 20000)
        # The apartment is 8 m by 7 m and its floor flat.
        for axis in (0, 1):
            along = sorted(point[axis] for point in points)
            self.assertLess(along[-len(along) // 500] - along[len(along) // 500], math.hypot(8, 7))
        on_the_floor = sum(1 for point in points if abs(point[2]) < 0.03)
        below = sum(1 for point in points if point[2] < -0.06)
        self.assertGreater(on_the_floor, 1000)
        self.assertLess(below, 0.01 * len(points))
        self.assertTrue((self.folder / "one/map.bt").read_bytes().startswith(b"# Octomap OcTree binary file"))

        self.mapweave("slam", world / "alpha.rawlog", "--sensor", "stereo", "--set", "output.ply=true",
                      "--set", "output.dense.every_frames=10", "--set", "output.dense.cloud.memory_mb=1", "--out", "pair")
        self.assertLess(len(ply_points(self.folder / "pair/map.ply")), 1e6 / 80)
        self.mapweave("slam", world / "alpha.rawlog", "--set", "output.ply=true", "--out", "laser")
        self.assertIn("no cloud of depth", (self.folder / "laser/summary.json").read_text())

    def test_cameras_of_one_robot_share_its_map(self):
        world = self.world
        self.mapweave("slam", world / "alpha.rawlog", "--sensor", "mono", "--out", "all")
        summary = json.loads((self.folder / "all/summary.json").read_text())
        self.assertEqual([camera["label"] for camera in summary["robots"][0]["cameras"]], ["mono", "rgbd", "stereo"])
        trajectories = sorted((self.folder / "all").glob("cameras/*/trajectory.tum"))
        self.assertEqual(len(trajectories), 3)
        robot = {row[0]: row[1:4] for row in poses(self.folder / "all/trajectory.tum")}
        for trajectory in trajectories:
            apart = [math.dist(row[1:4], robot[row[0]]) for row in poses(trajectory)]
            self.assertLess(max(apart), 0.15, trajectory)
        self.assertEqual(len(robot), len({row[0] for trajectory in trajectories for row in poses(trajectory)}))
        # Without depth, but with wheels.
        self.assertLess(self.error(self.folder / "all/trajectory.tum", world / "alpha.truth.tum"), 0.1)
        self.assertGreater(summary["robots"][0]["rig"]["extrinsic_constraints"], 10)

    def test_cameras_of_all_kinds_share_the_robots_map(self):
        world = self.world
        self.mapweave("slam", world / "alpha.rawlog", "--sensor", "cameras", "--out", "all")
        summary = json.loads((self.folder / "all/summary.json").read_text())
        self.assertEqual(summary["robots"][0]["rig"]["cameras"], ["rgbd", "stereo", "mono"])
        errors = [self.error(path, world / "alpha.truth.tum") for path in sorted((self.folder / "all").glob("cameras/*/trajectory.tum"))]
        self.assertEqual(len(errors), 3)
        self.assertLess(max(errors), 0.06)
        self.assertLess(self.error(self.folder / "all/trajectory.tum", world / "alpha.truth.tum"), 0.03)

    def test_the_laser_is_taken_where_there_is_one(self):
        world = self.world
        self.mapweave("slam", world / "alpha.rawlog", "--out", "auto")
        self.assertNotIn("cameras", json.loads((self.folder / "auto/summary.json").read_text())["robots"][0])

    def test_a_folder_and_the_rawlog_made_of_it_give_the_same_bytes(self):
        world = self.world
        folder = world / "alpha_rgbd"
        self.mapweave("convert", folder, "alpha_rgbd.rawlog")
        for threads, log, out in ((1, folder, "a"), (2, "alpha_rgbd.rawlog", "b")):
            self.mapweave("slam", log, "--threads", threads, "--out", out)
        for name in ("trajectory.robot.tum", "trajectory.optical.tum", "map.pcd"):
            self.assertEqual((self.folder / "a" / name).read_bytes(), (self.folder / "b" / name).read_bytes(), name)

    def test_folders_are_robots_logs_in_a_run(self):
        world = self.world
        (self.folder / "team.yaml").write_text(f"robots:\n  - {{id: alpha, log: {json.dumps(str(world / 'alpha_rgbd'))}}}\n")
        self.mapweave("run", "team.yaml", "--out", "team")
        self.assertTrue((self.folder / "team/robots/alpha/trajectory.tum").exists())

    def test_what_the_log_has_not_is_said(self):
        world = self.world
        done = self.mapweave("slam", world / "alpha_rgbd", "--sensor", "stereo", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "no stereo pair", "depth camera", "sensor")
        done = self.mapweave("slam", world / "alpha_rgbd", "--set", "visual.label=RGDB", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "RGDB", "did you mean 'RGBD'")
        self.assertFalse((self.folder / "no").exists())


if __name__ == "__main__":
    unittest.main()
