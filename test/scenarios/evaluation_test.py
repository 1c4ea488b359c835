"""What people did who compared maps with what they knew: trajectories of cameras and teams, other programs' files, exports."""
import json
import math
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import support

DATA = pathlib.Path(os.environ.get("MAPWEAVE_DATA", support.ROOT.parent / "shared/data"))
OPTICAL_DEG = 120.0  # between a robot and the optical frame of a camera that looks ahead


def rows(path):
    return [[float(value) for value in line.split()] for line in path.read_text().splitlines() if line and line[0] != "#"]


def write_rows(path, lines):
    path.write_text("".join(" ".join(f"{value:.9f}" for value in line) + "\n" for line in lines))
    return path


class Judging(support.Scenario):
    def judged(self, *arguments, **how):
        return json.loads(self.mapweave("evaluate", *arguments, "--json", **how).stdout)

    def trajectory(self, name, poses):
        return write_rows(self.folder / name, poses)

    def bend(self, count=200, stamp=100.0, off=0.0):
        """A robot on a bend with hills, a pose a decimetre and tenth of a second."""
        return [[stamp + 0.1 * i, 5 * math.sin(0.02 * i) + off, 5 - 5 * math.cos(0.02 * i), 0.3 * math.sin(0.05 * i),
                 0.0, 0.0, math.sin(0.01 * i), math.cos(0.01 * i)] for i in range(count)]


class Cameras(Judging):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        subprocess.run([support.PROGRAM, "simulate", support.ROOT / "configs/worlds/camera_tiny.yaml", "--set", "logs.layout=both",
                        "--out", cls.world], env=support.environment(), capture_output=True, check=True)
        cls.maps = cls.world.parent
        for log, out in ((cls.world / "alpha.rawlog", "robot"), (cls.world / "alpha_rgbd", "folder")):
            subprocess.run([support.PROGRAM, "slam", log, "--sensor", "rgbd", "--out", cls.maps / out], env=support.environment(),
                           capture_output=True, check=True)

    def test_a_cameras_trajectory_fits_the_truth_of_that_camera(self):
        truth = self.world / "alpha.rgbd.truth.tum"
        for out in ("robot", "folder"):
            numbers = self.judged("trajectory", self.maps / out / "trajectory.optical.tum", truth)
            self.assertLess(numbers["ate_translation_rmse_m"], 0.03)
            self.assertLess(numbers["ate_rotation_rmse_deg"], 3.0)
            self.assertNotIn("constant_rotation_deg", numbers)
        # of a log the robot's is the first to find, of a folder of pictures that which its own ground truth follows
        robot, optical = "trajectory.robot.tum", "trajectory.optical.tum"
        for out, same, other in (("robot", robot, optical), ("folder", optical, robot)):
            self.assertEqual((self.maps / out / "trajectory.tum").read_bytes(), (self.maps / out / same).read_bytes())
            self.assertNotEqual((self.maps / out / "trajectory.tum").read_bytes(), (self.maps / out / other).read_bytes())
        self.assertLess(self.judged("trajectory", self.maps / "robot/trajectory.tum", self.world / "alpha.truth.tum")["ate_rotation_rmse_deg"], 3.0)
        self.assertLess(self.judged("trajectory", self.maps / "folder", self.world / "alpha_rgbd")["ate_rotation_rmse_deg"], 3.0)

    def test_a_robot_compared_with_its_cameras_frame_is_found_out(self):
        pair = (self.maps / "robot/trajectory.tum", self.world / "alpha.rgbd.truth.tum")
        done = self.mapweave("evaluate", "trajectory", *pair, "--json")
        self.assert_says(done, "turned by 1", "different bodies", "--sensor optical", "--extrinsics auto")
        errors = json.loads(done.stdout)
        self.assertAlmostEqual(errors["constant_rotation_deg"], OPTICAL_DEG, delta=3.0)
        self.assertGreater(errors["ate_rotation_rmse_deg"], 100.0)
        for kept in ("keep", "tell"):  # its old name
            self.assertEqual(self.judged("trajectory", *pair, "--extrinsics", kept), errors)
        removed = self.judged("trajectory", *pair, "--extrinsics", "auto")
        self.assertLess(removed["ate_rotation_rmse_deg"], 3.0)
        self.assertLess(removed["rpe_rotation_rmse_deg"], errors["rpe_rotation_rmse_deg"] + 1e-9)
        self.assertLess(self.judged("trajectory", *pair, "--sensor", "optical")["ate_rotation_rmse_deg"], 3.0)
        self.assert_says(self.mapweave("evaluate", "trajectory", *pair, "--sensor", "1,2", code=support.USAGE), "--sensor", "optical")

    def test_export_that_cannot_give_what_was_asked_is_an_error_and_writes_nothing(self):
        store = self.maps / "robot/map.mwdb"
        self.assert_says(self.mapweave("export", store, "--out", "no", "--png", "--pgm", code=support.BAD_INPUT), "--pgm", "laser's scans")
        self.assert_nothing_left("no")
        self.mapweave("export", store, "--out", "seen", "--png", "--pcd", "--tum", "--g2o")
        for name in ("map.png", "map.pcd", "trajectory.tum", "trajectory.optical.tum", "map.g2o"):
            self.assertGreater((self.folder / "seen" / name).stat().st_size, 100, name)
        shutil.copy(store, self.folder / "elsewhere.mwdb")
        done = self.mapweave("export", "elsewhere.mwdb", "--out", "no", "--ply", code=support.BAD_INPUT)
        self.assert_says(done, "--ply", "--log alpha=PATH")
        self.assert_nothing_left("no")

    def test_the_pose_graph_of_a_camera_map_has_edges(self):
        self.mapweave("export", self.maps / "robot/map.mwdb", "--out", "graph", "--g2o")
        words = [line.split() for line in (self.folder / "graph/map.g2o").read_text().splitlines() if line[0] != "#"]
        vertices = {line[1]: line[0] for line in words if line[0].startswith("VERTEX")}
        edges = [line for line in words if line[0] == "EDGE_PROJECT_DISPARITY"]
        self.assertGreater(len(edges), 1000)
        for edge in edges:
            self.assertEqual(len(edge), 4 + 3 + 6)
            self.assertEqual((vertices[edge[1]], vertices[edge[2]]), ("VERTEX_SE3:QUAT", "VERTEX_TRACKXYZ"))

    def test_surfaces_are_exported_from_a_stored_map_whose_log_is_there(self):
        self.mapweave("export", self.maps / "robot/map.mwdb", "--out", "beside", "--ply", "--octomap")
        shutil.copy(self.maps / "robot/map.mwdb", self.folder / "elsewhere.mwdb")
        self.mapweave("export", "elsewhere.mwdb", "--out", "given", "--set", "output.ply=true", "--log", self.world / "alpha.rawlog")
        for name in ("map.ply", "map.dense.pcd", "map.bt", "map.ot"):
            self.assertGreater((self.folder / "beside" / name).stat().st_size, 10000, name)
        self.assertEqual((self.folder / "beside/map.ply").read_bytes(), (self.folder / "given/map.ply").read_bytes())
        self.assert_says(self.mapweave("export", "elsewhere.mwdb", "--out", "no", "--ply", "--log", "nowhere", code=support.BAD_INPUT), "nowhere")


class Teams(Judging):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        cls.team = cls.world.parent / "team"
        for command in (("simulate", support.ROOT / "configs/worlds/apartment.yaml", "--out", cls.world), ("run", cls.world / "run.yaml", "--out", cls.team)):
            subprocess.run([support.PROGRAM, *command], env=support.environment(), capture_output=True, check=True)

    def test_no_pose_is_lost_of_robots_that_drove_at_the_same_time(self):
        robots = ("alpha", "beta", "gamma")
        scans = {robot: json.loads(self.mapweave("inspect", self.world / f"{robot}.rawlog", "--json").stdout)["scans"] for robot in robots}
        team = {robot: len(rows(self.team / f"team/trajectories/{robot}.tum")) for robot in robots}
        self.assertEqual(team, scans)
        self.assertFalse((self.team / "team/trajectory.tum").exists(), "a file of all robots would have two poses at one time")

    def test_a_team_is_judged_by_one_alignment_each_robot_and_together(self):
        numbers = self.judged("trajectory", self.team, self.world)
        self.assertEqual(set(numbers["robots"]), {"alpha", "beta", "gamma"})
        self.assertEqual(numbers["pairs"], sum(robot["pairs"] for robot in numbers["robots"].values()))
        self.assertLess(numbers["ate_translation_rmse_m"], 0.1)
        table = self.mapweave("evaluate", "trajectory", "--estimate", self.team, "--reference", self.world, "--plot", "team.png").stdout
        for word in ("alpha", "beta", "gamma", "together", "ate_translation_rmse_m"):
            self.assertIn(word, table)
        self.assertTrue((self.folder / "team.png").read_bytes().startswith(b"\x89PNG"))
        # One robot that lies 1 m off in the team's frame: an alignment of its own would hide it.
        moved = self.folder / "moved/trajectories"
        shutil.copytree(self.team / "team/trajectories", moved)
        write_rows(moved / "beta.tum", [[*row[:2], row[2] + 1.0, *row[3:]] for row in rows(moved / "beta.tum")])
        self.assertGreater(self.judged("trajectory", self.folder / "moved", self.world)["ate_translation_rmse_m"], 0.3)
        (self.folder / "some").mkdir()
        shutil.copy(self.world / "alpha.truth.tum", self.folder / "some/alpha.truth.tum")
        self.assert_says(self.mapweave("evaluate", "trajectory", self.team, "some", code=support.BAD_INPUT), "beta", "beta.truth.tum")

    def test_relations_judge_a_team(self):
        truth = rows(self.world / "alpha.truth.tum")
        lines = []
        for first, second in zip(truth[::20], truth[15::20]):
            heading = [2 * math.atan2(row[6], row[7]) for row in (first, second)]
            dx, dy = second[1] - first[1], second[2] - first[2]
            c, s = math.cos(heading[0]), math.sin(heading[0])
            lines.append([first[0], second[0], c * dx + s * dy, c * dy - s * dx, 0, 0, 0, heading[1] - heading[0]])
        write_rows(self.folder / "alpha.relations", lines)
        numbers = self.judged("relations", self.team, "alpha.relations")
        self.assertEqual(numbers["used"], len(lines))
        self.assertEqual(numbers["robots"]["alpha"]["used"], len(lines))
        self.assertLess(numbers["translation_mean_m"], 0.05)
        flags = self.judged("relations", "--trajectory", self.team / "team/trajectories/alpha.tum", "--relations", "alpha.relations")
        self.assertEqual(flags["used"], len(lines))
        self.mapweave("evaluate", "relations", self.team, "alpha.relations", "--max", "translation_mean_m=0.000001", code=support.GATE_FAILED)

    def test_one_robot_of_a_team_is_exported(self):
        self.mapweave("export", self.team / "team/map.mwdb", "--out", "beta", "--robot", "beta", "--tum", "--pgm")
        self.assertEqual((self.folder / "beta/trajectory.tum").read_bytes(), (self.team / "team/trajectories/beta.tum").read_bytes())
        self.assert_says(self.mapweave("export", self.team / "team/map.mwdb", "--out", "no", "--robot", "bete", code=support.USAGE), "bete", "alpha, beta, gamma")
        self.mapweave("export", self.team / "team", "--out", "all", "--tum")
        self.assertEqual({path.name for path in (self.folder / "all/trajectories").iterdir()}, {"alpha.tum", "beta.tum", "gamma.tum"})

    def test_trajectories_of_a_grid_are_an_error_and_no_empty_file(self):
        done = self.mapweave("export", self.team / "team/map.yaml", "--out", "no", "--tum", code=support.BAD_INPUT)
        self.assert_says(done, "--tum", "poses of robots")
        self.assert_nothing_left("no")
        self.mapweave("export", self.team / "team/map.yaml", "--out", "grid")
        self.assertFalse((self.folder / "grid/trajectory.tum").exists())

    def test_grids_in_different_frames_are_aligned_before_they_are_compared(self):
        whole, part = self.team / "team/map.yaml", self.team / "robots/gamma/map.yaml"
        apart = self.judged("grids", whole, part)
        aligned = self.judged("grids", whole, part, "--align", "auto")
        self.assertGreater(aligned["wall_iou"], apart["wall_iou"])
        self.assertGreater(aligned["agreement"], 0.9)
        given = f"{aligned['a_from_b_x_m']},{aligned['a_from_b_y_m']},{aligned['a_from_b_yaw_rad']}"
        self.assertAlmostEqual(self.judged("grids", whole, part, "--align", given)["agreement"], aligned["agreement"], delta=0.02)
        self.assert_says(self.mapweave("evaluate", "grids", whole, part, "--align", "1,2", code=support.USAGE), "--align")


class Files(Judging):
    def test_files_of_every_data_set_are_read_and_written(self):
        estimate = self.trajectory("estimate.tum", self.bend())
        for to, form in (("there.csv", "auto"), ("there.txt", "kitti"), ("back.tum", "auto")):
            self.mapweave("evaluate", "convert", estimate, to, "--to", form)
            numbers = self.judged("trajectory", to, estimate)
            self.assertEqual(numbers["pairs"], 200)
            self.assertLess(numbers["ate_translation_rmse_m"] + numbers["ate_rotation_rmse_deg"], 1e-3)
        planar = self.trajectory("planar.txt", [[row[0], row[1], row[2], 2 * math.atan2(row[6], row[7])] for row in self.bend()])
        self.assertLess(self.judged("trajectory", estimate, planar)["ate_translation_mean_m"], 0.3)
        (self.folder / "there.times.txt").unlink()
        self.assert_says(self.mapweave("evaluate", "trajectory", "there.txt", estimate, code=support.BAD_INPUT), "times.txt", "--times")
        self.assert_says(self.mapweave("evaluate", "convert", estimate, "where.dat", code=support.USAGE), "--to")
        self.write("frames.txt", "100.05\n100.15\n")
        self.mapweave("evaluate", "convert", estimate, "frames.kitti", "--to", "kitti", "--at", "frames.txt")
        self.assertEqual(len(rows(self.folder / "frames.kitti")), 2)
        self.write("frames.txt", "100.05\n190\n")
        self.assert_says(self.mapweave("evaluate", "convert", estimate, "no.kitti", "--to", "kitti", "--at", "frames.txt", code=support.BAD_INPUT), "190")

    def test_several_runs_stand_in_one_table(self):
        truth = self.trajectory("truth.tum", self.bend())
        runs = [self.trajectory(f"run{i}.tum", [[*row[:3], row[3] + 0.01 * i * math.sin(3 * row[0]), *row[4:]] for row in self.bend()]) for i in range(3)]
        done = self.mapweave("evaluate", "trajectory", *runs, truth, "--plot", "runs.png")
        lines = done.stdout.splitlines()
        self.assertEqual([line.split()[0] for line in lines[1:]], list(map(str, runs)))
        self.assertTrue((self.folder / "runs.png").read_bytes().startswith(b"\x89PNG"))
        self.assertEqual(len(self.judged("trajectory", *runs, "--reference", truth)["runs"]), 3)
        self.mapweave("evaluate", "trajectory", *runs, truth, "--max", "ate_translation_rmse_m=0.012", code=support.GATE_FAILED)
        self.assert_says(self.mapweave("evaluate", "trajectory", truth, code=support.USAGE), "no estimate", "ESTIMATE REFERENCE")

    def test_drift_is_measured_as_kitti_does(self):
        def straight(step):
            return [[0.1 * i, step * i, 0.0, 0.0, 0, 0, 0, 1] for i in range(250)]
        numbers = self.judged("trajectory", self.trajectory("e.tum", straight(1.01)), self.trajectory("r.tum", straight(1.0)), "--align", "none")
        self.assertAlmostEqual(numbers["drift_100m_translation_percent"], 1.01, places=3)
        self.assertAlmostEqual(numbers["drift_200m_translation_percent"], 1.005, places=3)
        self.assertNotIn("drift_300m_translation_percent", numbers)

    def test_a_reference_of_a_tenth_of_the_run_is_noted(self):
        done = self.mapweave("evaluate", "trajectory", self.trajectory("e.tum", self.bend()), self.trajectory("r.tum", self.bend(20)), "--json")
        self.assert_says(done, "covers 10 %")
        self.assertLess(json.loads(done.stdout)["covered"], 0.11)

    def test_an_archive_as_downloaded_says_how_to_unpack_it(self):
        (self.folder / "walk").mkdir()
        self.write("walk/rgb.txt", "1.0 rgb/1.png\n")
        for name, form, word in (("walk.zip", "zip", "unzip"), ("walk.tgz", "gztar", "tar -x")):
            made = shutil.make_archive(str(self.folder / "packed"), form, self.folder, "walk")
            shutil.move(made, self.folder / name)
            self.assert_says(self.mapweave("slam", name, "--out", "no", code=support.BAD_INPUT), word, name)
        self.assert_says(self.mapweave("slam", "walk", "--out", "no", code=support.BAD_INPUT), "camera.yaml", "width")
        (self.folder / "walk").rename(self.folder / "rgbd_dataset_freiburg1_walk")
        done = self.mapweave("slam", "rgbd_dataset_freiburg1_walk", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "freiburg1", "whose calibration is used", "1.png")

    def test_freiburg1_rpy_has_the_relative_error_that_evo_says(self):
        log = DATA / "visual/tum_fr1_rpy"
        if not log.exists():
            raise unittest.SkipTest(f"needs {log}")
        # As downloaded: the data set's own name, and no calibration.
        as_downloaded = self.folder / "rgbd_dataset_freiburg1_rpy"
        as_downloaded.mkdir()
        for name in ("rgb", "depth", "rgb.txt", "depth.txt", "groundtruth.txt"):
            if (log / name).exists():
                (as_downloaded / name).symlink_to(log / name)
        self.mapweave("slam", as_downloaded, "--out", "rpy", seconds=600)
        numbers = self.judged("trajectory", "rpy", as_downloaded)
        self.assertAlmostEqual(numbers["ate_translation_rmse_m"], 0.0109, delta=0.002)
        self.assertAlmostEqual(numbers["rpe_translation_rmse_m"], 0.00799, delta=0.0004)
        self.assertAlmostEqual(numbers["rpe_rotation_rmse_deg"], 0.556, delta=0.03)


if __name__ == "__main__":
    support.main()
