"""Sessions of users of results: who simulates, evaluates, hands maps to other tools, and asks why maps were not merged."""
import bisect
import json
import math
import shutil

import strict_readers
import support
from messages_test import other_room_lines
from strict_readers import Grid, read_tum
from support import APART, BAD_INPUT, DONE, USAGE
from users import OfAFlat, Session, associated, relative_errors


class Simulation(OfAFlat):
    """Makes a world, maps it, and compares with what is true."""

    STEPS = [("simulate", "flat.yaml", "--set", "logs.layout=both", "--out", "flat", "--json")]

    def test_from_the_world_to_the_error_nothing_is_dropped(self):
        made = {line["robot"]: line for line in json.loads(self.said)}
        self.assertEqual(set(made), {"alpha", "beta"})
        for robot, line in made.items():
            log = self.json_of("inspect", f"flat/{robot}.rawlog")
            camera = next(sensor for sensor in log["sensors"] if "camera" in sensor)
            self.assertEqual((log["scans"], camera["count"]), (line["scans"], line["frames"]))
            self.assertEqual(self.json_of("inspect", f"flat/{robot}_rgbd")["sensors"][0]["count"], line["frames"], "the same as a folder of pictures")
            self.assertAlmostEqual(log["odometry_length_m"], line["length_m"], delta=0.2)
            self.assertEqual(self.poses(f"flat/{robot}.rgbd.truth.tum"), line["frames"])
        self.assertEqual(self.mapweave("config", "check", "flat/run.yaml").stderr, "")
        summary = self.json_of("run", "flat/run.yaml", "--out", "mapped")
        self.assertEqual({robot["id"]: robot["scans"] for robot in summary["robots"]}, {robot: line["scans"] for robot, line in made.items()})
        self.assertEqual(self.robots_in("mapped"), {"team": ["alpha", "beta"]})
        for robot, line in made.items():
            self.assertEqual(self.poses(f"mapped/team/trajectories/{robot}.tum"), line["scans"])
        numbers = self.json_of("evaluate", "trajectory", "mapped", "flat", "--max", "ate_translation_rmse_m=0.05")
        self.assertEqual({robot: one["pairs"] for robot, one in numbers["robots"].items()}, {robot: line["scans"] for robot, line in made.items()})
        self.assert_whole("mapped")

    def test_what_a_camera_saw_is_judged_by_the_truth_of_that_camera(self):
        summary = self.json_of("run", "flat/run.yaml", "--set", "sensor=rgbd", "--out", "seen", code=(DONE, APART))
        for robot in summary["robots"]:
            camera, = robot["cameras"]
            own = f"seen/robots/{robot['id']}"
            self.assertEqual(self.poses(f"{own}/trajectory.optical.tum"), camera["tracked"])
            self.assertEqual(camera["frames"], self.poses(f"flat/{robot['id']}.rgbd.truth.tum"))
            for estimate, truth in (("optical", "rgbd.truth"), ("robot", "truth")):
                done = self.mapweave("evaluate", "trajectory", f"{own}/trajectory.{estimate}.tum", f"flat/{robot['id']}.{truth}.tum", "--json")
                numbers = json.loads(done.stdout)
                self.assertNotIn("turned by", done.stderr)
                self.assertLess(numbers["ate_translation_rmse_m"], 0.05, estimate)
                self.assertLess(numbers["ate_rotation_rmse_deg"], 3.0, estimate)
            self.assertEqual(len(associated(read_tum(self.folder / own / "trajectory.optical.tum"), read_tum(self.folder / f"flat/{robot['id']}.rgbd.truth.tum"))),
                             camera["tracked"])
        # The same pictures as a folder: the truth lies in it, under the data set's own name.
        self.mapweave("slam", "flat/alpha_rgbd", "--out", "folder")
        self.assertLess(self.json_of("evaluate", "trajectory", "folder", "flat/alpha_rgbd")["ate_rotation_rmse_deg"], 3.0)


class Evaluator(Session):
    """Compares programs whose trajectories come in everybody's forms."""

    FORMS = (("tum", "tum"), ("kitti", "txt"), ("euroc", "csv"))
    NUMBERS = ("ate_translation_rmse_m", "ate_rotation_rmse_deg", "rpe_translation_rmse_m", "rpe_rotation_rmse_deg", "drift_100m_translation_percent")

    def write_poses(self, name, noise=0.0, drift=1.0, count=400):
        """Hills and bends over 160 m, half a metre a pose."""
        lines = []
        for i in range(count):
            yaw, off = 0.4 * math.sin(0.03 * i), noise * math.sin(1.7 * i)
            lines.append(f"{100 + 0.1 * i:.6f} {drift * 0.4 * i + off:.9f} {3 * math.sin(0.05 * i) - off:.9f} {math.sin(0.02 * i):.9f} 0 0 "
                         f"{math.sin(yaw / 2 + off / 10):.9f} {math.cos(yaw / 2 + off / 10):.9f}")
        return self.write_log(name, lines)

    def test_every_form_gives_the_same_numbers(self):
        self.write_poses("truth.tum")
        self.write_poses("mine.tum", 0.05, 1.01)
        for name in ("truth", "mine"):
            for form, ending in self.FORMS[1:]:
                self.mapweave("evaluate", "convert", f"{name}.tum", f"{name}.{ending}", "--to", form)
        expected = self.json_of("evaluate", "trajectory", "mine.tum", "truth.tum")
        self.assertEqual((expected["pairs"], expected["covered"]), (400, 1.0))
        metres, degrees = relative_errors(read_tum(self.folder / "mine.tum"), read_tum(self.folder / "truth.tum"))
        self.assertAlmostEqual(expected["rpe_translation_rmse_m"], metres, delta=1e-8)
        self.assertAlmostEqual(expected["rpe_rotation_rmse_deg"], degrees, delta=1e-5)
        for _, one in self.FORMS:
            for _, other in self.FORMS:
                with self.subTest(f"{one} against {other}"):
                    found = self.json_of("evaluate", "trajectory", f"mine.{one}", f"truth.{other}")
                    self.assertEqual(found["pairs"], 400)
                    for key in self.NUMBERS:
                        self.assertAlmostEqual(found[key], expected[key], delta=1e-4 * max(0.1, expected[key]), msg=key)

    def test_a_table_has_every_run_and_its_numbers_are_those_of_each_alone(self):
        truth = self.write_poses("truth.tum")
        runs = [self.write_poses(f"run{i}.tum", 0.02 * i, 1 + 0.002 * i, 400 - 100 * i) for i in range(3)]
        done = self.mapweave("evaluate", "trajectory", *runs, truth, "--plot", "errors.png")
        head, *lines = [line.split() for line in done.stdout.splitlines()]
        table = {line[0]: dict(zip(head, line[1:])) for line in lines}
        self.assertEqual(list(table), runs)
        together = self.json_of("evaluate", "trajectory", *runs, truth)["runs"]
        self.assertEqual(len(together), 3)
        for name, count, run in zip(runs, (400, 300, 200), together):
            alone = self.json_of("evaluate", "trajectory", name, truth)
            self.assertEqual((alone["pairs"], table[name]["pairs"]), (count, str(count)))
            for key in self.NUMBERS[:4]:
                self.assertEqual(run[key], alone[key], f"{name}: {key}")
                self.assertAlmostEqual(float(table[name][key]), alone[key], delta=1e-5 * max(1.0, alone[key]))
        columns, rows = strict_readers.read_png(self.folder / "errors.png")
        self.assertGreater(min(columns, rows), 300)
        # A run that is not there, or that shares no time with the reference, is an error: no table of those that are left.
        self.mapweave("evaluate", "trajectory", *runs, "lost.tum", truth, code=BAD_INPUT)
        self.write_log("other.tum", ["9000 0 0 0 0 0 0 1", "9001 1 0 0 0 0 0 1", "9002 2 0 0 0 0 0 1"])
        self.assert_says(self.mapweave("evaluate", "trajectory", *runs, "other.tum", truth, code=BAD_INPUT), "other.tum")


class HandingOver(OfAFlat):
    """Takes maps to other tools, whose readers are strict."""

    STEPS = [("simulate", "flat.yaml", "--out", "flat"), ("run", "flat/run.yaml", "--out", "mapped"),
             ("slam", "flat/alpha.rawlog", "--sensor", "rgbd", "--out", "seen")]

    def test_every_format_of_a_team_of_lasers_is_read_and_all_show_one_map(self):
        self.mapweave("export", "mapped/team", "--out", "out", "--png", "--pgm", "--pcd", "--tum", "--g2o", "--octomap")
        out = self.folder / "out"
        grid = Grid(out / "map.yaml")
        self.assertEqual(strict_readers.read_png(out / "map.png"), (grid.columns, grid.rows))
        strict_readers.read_png(out / "map.color.png")
        points = strict_readers.read_pcd(out / "map.pcd")
        near = {(int(x // 0.1) + i, int(y // 0.1) + j) for x, y, _ in points for i in (-1, 0, 1) for j in (-1, 0, 1)}
        self.assertTrue(all((int(x // 0.1), int(y // 0.1)) in near for x, y in grid.walls()), "a wall of the grid is not in the cloud")
        poses = [read_tum(out / f"trajectories/{robot}.tum") for robot in ("alpha", "beta")]
        scans = {robot["id"]: robot["scans"] for robot in self.read_json("mapped/summary.json")["robots"]}
        self.assertEqual([len(one) for one in poses], [scans["alpha"], scans["beta"]])
        self.assertFalse(any(grid.is_wall(row[1], row[2]) for one in poses for row in one), "a robot drove in a wall")
        vertices, edges = strict_readers.read_g2o(out / "map.g2o")
        self.assertEqual(len(vertices), sum(scans.values()))
        self.assertGreater(len(edges), len(vertices))
        places = sorted((x, y) for x, y, *_ in (numbers for _, numbers in vertices.values()))
        for row in (row for one in poses for row in one):
            near = places[bisect.bisect_left(places, (row[1] - 1e-5,)):bisect.bisect_right(places, (row[1] + 1e-5, math.inf))]
            self.assertTrue(any(abs(y - row[2]) < 1e-5 for _, y in near), f"no vertex at {row[1:3]}")
        self.assertEqual({path.name for path in out.iterdir()} - {"config.yaml", "manifest.json"},
                         {"map.png", "map.color.png", "map.yaml", "map.pgm", "map.pcd", "trajectories", "map.g2o", "map.bt", "map.ot"})
        cells = sum(cell != 205 for cell in grid.cells)
        for name in ("map.bt", "map.ot"):
            size_m, nodes = strict_readers.read_octomap(out / name)
            self.assertEqual(size_m, 0.05)
            self.assertGreater(nodes, cells, "a leaf for each cell that is known")

    def test_octomaps_of_lasers_are_written_of_whom_one_asks_and_made_later_without_the_logs(self):
        def trees(results):
            return sorted(str(path.parent.relative_to(self.folder / results)) for path in (self.folder / results).rglob("map.bt"))

        self.mapweave("run", "flat/run.yaml", "--set", "output.octomap=true", "--out", "all")
        self.assertEqual(trees("all"), ["edges/edge0", "robots/alpha", "robots/beta", "team"])
        self.mapweave("run", "flat/run.yaml", "--set", "output.octomap=true", "--set", "output.octomaps_of=edges", "--out", "some")
        self.assertEqual(trees("some"), ["edges/edge0", "team"])
        self.mapweave("merge", "mapped", "--set", "output.octomap=true", "--set", "output.octomaps_of=team", "--out", "merged")
        self.assertEqual(trees("merged"), ["team"])
        self.mapweave("slam", "flat/alpha.rawlog", "--set", "output.octomap=true", "--out", "one")
        self.assertEqual(trees("one"), ["."])
        self.assertNotIn("depth", str(self.read_json("one/summary.json")["notes"]), "a laser needs none")
        self.assertEqual(trees("mapped"), [])
        for given, same in (("mapped/team", "all/team"), ("mapped/robots/alpha", "all/robots/alpha"), ("mapped/edges/edge0", "all/edges/edge0"),
                            ("mapped/team/map.yaml", None)):
            self.mapweave("export", given, "--octomap", "--out", "later", "--force")
            strict_readers.read_octomap(self.folder / "later/map.bt")
            if same:
                self.assertEqual((self.folder / "later/map.bt").read_bytes(), (self.folder / same / "map.bt").read_bytes(), given)

    def test_every_format_of_a_camera_is_read(self):
        self.mapweave("export", "seen", "--out", "out", "--png", "--pcd", "--tum", "--g2o", "--ply", "--octomap")
        out, seen = self.folder / "out", self.json_of("inspect", "seen/map.mwdb")["maps"][0]
        strict_readers.read_png(out / "map.png")
        self.assertEqual(len(strict_readers.read_pcd(out / "map.pcd")), seen["landmarks"])
        for name in ("trajectory.tum", "trajectory.optical.tum"):
            self.assertEqual(len(read_tum(out / name)), seen["keyframes"])
        vertices, edges = strict_readers.read_g2o(out / "map.g2o")
        self.assertEqual(sum(tag == "VERTEX_SE3:QUAT" for tag, _ in vertices.values()), seen["keyframes"])
        self.assertGreater(len(edges), len(vertices))
        cloud = strict_readers.read_ply(out / "map.ply")
        self.assertEqual(cloud, strict_readers.read_pcd(out / "map.dense.pcd"))
        trees = [strict_readers.read_octomap(out / name) for name in ("map.bt", "map.ot")]
        self.assertEqual(trees[0][0], trees[1][0])
        self.assertGreater(min(nodes for _, nodes in trees), 1000)

    def test_what_cannot_be_written_is_an_error_that_says_what_it_needs(self):
        shutil.copy(self.base / "seen/map.mwdb", self.folder / "alone.mwdb")
        for asked, words in ((("seen", "--pgm"), ("--pgm",)), (("seen", "--png", "--pgm", "--tum"), ("--pgm",)), (("alone.mwdb", "--octomap"), ("--octomap", "--log")),
                             (("mapped/team/map.yaml", "--ply"), ("--ply",)), (("mapped/team/map.yaml", "--pgm", "--tum"), ("--tum",)),
                             (("mapped/team", "--ply", "--robot", "gamma"), ("gamma", "alpha"))):
            with self.subTest(" ".join(asked)):
                self.assert_says(self.mapweave("export", *asked, "--out", "no", code=(BAD_INPUT, USAGE)), *words)
                self.assert_nothing_left("no")


class NotMerged(Session):
    """Has maps that stayed apart, asks why, and changes what was decided."""

    def test_the_reason_is_the_same_wherever_one_looks_and_everything_can_be_undone(self):
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--out", "logs")
        self.write_log("hall.log", other_room_lines(40))
        self.configuration([("alpha", "logs/robot0.rawlog"), ("beta", "logs/robot1.rawlog"), ("hall", "hall.log")])
        done = self.mapweave("run", "team.yaml", "--set", "cloud.thin_maps=false", "--out", "first", code=APART)
        self.assertEqual(self.robots_in("first"), {"team-1": ["alpha", "beta"], "team-2": ["hall"]})
        self.assert_same_words(done, "first", {("alpha", "beta"): True, ("alpha", "hall"): False, ("beta", "hall"): False})

        done = self.mapweave("merge", "first", "--refuse", "alpha,beta", "--out", "refused", code=APART)
        self.assert_same_words(done, "refused", {("alpha", "beta"): False, ("alpha", "hall"): False, ("beta", "hall"): False})
        self.assertEqual(sorted(sum(self.robots_in("refused").values(), [])), ["alpha", "beta", "hall"])
        self.assertIn("excluded", [pair["reason"] for pair in self.read_json("refused/merges.json")])
        # What was said holds until it is taken back, and then everything is as it was.
        again = self.mapweave("merge", "refused", "--out", "again", code=APART)
        self.assertIn("note: as before: alpha and beta are never matched", again.stdout)
        self.assertEqual(len(self.robots_in("again")), 3)
        self.mapweave("merge", "again", "--forget-requests", "--frame", "alpha", "--out", "undone", code=APART)
        self.assertEqual(self.robots_in("undone"), self.robots_in("first"))
        self.assert_same_map("undone/team-1", "first/team-1")

        # Judgements that are not believed, until the vetoes are taken back.
        self.mapweave("merge", "first", "--out", "believed", code=APART)
        witnesses = [pair["witnesses"] for pair in self.read_json("believed/merges.json") if (pair["a"], pair["b"]) == ("alpha", "beta")][0]
        self.mapweave("merge", "first", *(word for witness in witnesses for word in ("--veto", witness)), "--out", "vetoed", code=APART)
        self.assertEqual(len(self.robots_in("vetoed")), 3)
        self.assertIn("vetoed", [pair["reason"] for pair in self.read_json("vetoed/merges.json")])
        again = self.mapweave("merge", "vetoed", "--out", "vetoed-still", code=APART)
        self.assertRegex(again.stdout, "note: as before: judgement [0-9a-f]{64} of alpha and beta is not believed")
        self.assertEqual(len(self.robots_in("vetoed-still")), 3)
        self.mapweave("merge", "vetoed", "--forget-requests", "--frame", "alpha", "--out", "believed-again", code=APART)
        self.assertEqual(self.robots_in("believed-again"), self.robots_in("first"))
        self.assert_says(self.mapweave("merge", "first", "--veto", "alpha,beta", "--out", "no", code=USAGE), "--veto", "witnesses")
        self.assertIn("its veto (--veto) changes nothing", self.mapweave("merge", "first", "--veto", 64 * "0", "--out", "nothing", code=APART).stdout)

        # Without the robot that does not belong: exit code 0, and the map that never had it.
        done = self.mapweave("merge", "first", "--without", "hall", "--out", "two")
        self.assertIn("left out: hall", done.stdout)
        self.assertEqual(self.robots_in("two"), {"team": ["alpha", "beta"]})
        self.mapweave("merge", "first/robots/alpha", "first/robots/beta", "--out", "never")
        self.assert_same_map("two/team", "never/team")

    def assert_same_map(self, one, other):
        for name in ("map.pgm", "map.pcd", "trajectories/alpha.tum", "trajectories/beta.tum"):
            self.assertEqual((self.folder / one / name).read_bytes(), (self.folder / other / name).read_bytes(), name)

    def assert_same_words(self, done, results, merged):
        """The console, merges.json, explain and the page say the same of every pair, and leave none out."""
        pairs = [pair for pair in self.read_json(f"{results}/merges.json") if pair["tier"] == "cloud"]
        self.assertEqual({(pair["a"], pair["b"]): pair["accepted"] for pair in pairs}, merged)
        page = (self.folder / results / "report.html").read_text()
        for pair in pairs:
            self.assertIn(f"cloud: {pair['words']}\n", done.stdout)
            said = self.mapweave("explain", results, pair["b"], pair["a"], "--out", "pair.png").stdout
            self.assertIn(pair["words"], said)
            if not pair["accepted"]:
                self.assertIn("what helps: ", said)
                self.assertNotEqual(pair["reason"], "none")
            self.assertIn(json.dumps(pair["words"], ensure_ascii=False)[1:-1], page)
        for robot in sorted({robot for pair in merged for robot in pair}):
            self.assertIn(f'"{robot}"', page)


if __name__ == "__main__":
    support.main()
