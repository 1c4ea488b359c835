"""The command line: help that teaches, exit codes, --json, --force, and the files that every verb promises."""
import json
import math
import pathlib
import re
import shutil
import struct

import support
from support import APART, BAD_INPUT, CANNOT_WRITE, DONE, GATE_FAILED, USAGE, VERBS

ONE_MAP = {"config.yaml", "report.html", "manifest.json", "summary.json", "map.mwdb", "map.png", "map.color.png", "map.pgm", "map.yaml", "map.pcd", "trajectory.tum"}
OF_A_FOLDER = {name for name in ONE_MAP if name.startswith("map.")} | {"trajectory.tum"}


def names(folder):
    return {path.name for path in folder.iterdir()}


class Help(support.Scenario):
    def test_the_program_lists_its_verbs_and_exit_codes(self):
        text = self.mapweave("--help").stdout
        self.assertEqual(re.findall(r"^  (\w+) ", text.split("\nVerbs:\n")[1].split("\n\n")[0], re.MULTILINE), list(VERBS))
        self.assertIn("130", text)

    def test_every_verb_explains_itself_with_an_example(self):
        for verb in VERBS:
            with self.subTest(verb):
                self.assertIn(f"mapweave {verb}", self.mapweave(verb, "--help").stdout)

    def test_a_wrong_command_line_is_exit_code_2(self):
        for wrong in ([], ["fly"], ["run"], ["slam", "a.rawlog"], ["slam", "a.rawlog", "--out", "o", "--engine", "magic"],
                      ["slam", "a.rawlog", "--out", "o", "--no-such-option"], ["split", "a.rawlog", "--out", "o", "--robots", "none"],
                      ["evaluate"], ["evaluate", "trajectory", "--estimate", "a", "--reference", "b", "--align", "sideways"]):
            with self.subTest(" ".join(wrong)):
                self.assertNotEqual(self.mapweave(*wrong, code=USAGE).stderr, "")

    def test_a_number_out_of_range_is_exit_code_2(self):
        trajectory = ("evaluate", "trajectory", "--estimate", "a", "--reference", "b", "--align", "se2")
        for wrong in ("0", "-1", "1.5", "nan"):
            with self.subTest(wrong):
                self.assert_says(self.mapweave(*trajectory, f"--delta={wrong}", code=USAGE), "--delta")
        self.assert_says(self.mapweave("evaluate", "grids", "a.yaml", "b.yaml", "--wall-tolerance=-1", code=USAGE), "--wall-tolerance")

    def test_an_unknown_key_is_met_with_file_line_and_the_nearest_name(self):
        self.write("a.log", "\n".join(support.room_lines(3)) + "\n")
        config = self.write("team.yaml", "robots:\n  - {id: alpha, log: a.log}\nlaser:\n  engin: graph\n")
        self.assert_says(self.mapweave("config", "check", config, code=BAD_INPUT), "team.yaml:4", "engin", "'engine'")

    def test_set_reaches_an_option_and_refuses_an_unknown_one(self):
        self.assertIn("engine: icp", self.mapweave("config", "show", "--set", "laser.engine=icp").stdout)
        self.assert_says(self.mapweave("config", "show", "--set", "laser.engin=icp", code=(USAGE, BAD_INPUT)), "laser.engine")


class Inputs(support.Scenario):
    def test_force_never_replaces_what_is_read(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.mapweave("split", "room.log", "--robots", "2", "--out", "logs")
        self.mapweave("slam", "logs/robot0.rawlog", "--out", "map")
        before = sorted((path, path.stat().st_size) for path in self.folder.rglob("*"))
        for verb in (("run", "logs/run.yaml", "--out", "logs"), ("slam", "logs/robot0.rawlog", "--out", "logs/"), ("split", "logs/robot0.rawlog", "--robots", "2", "--out", "logs"),
                     ("merge", "map/map.mwdb", "--out", "map"), ("export", "map/map.mwdb", "--out", "./map"), ("merge", "map/map.yaml", "--out", self.folder / "map")):
            with self.subTest(" ".join(map(str, verb))):
                self.assert_says(self.mapweave(*verb, "--force", code=USAGE), "holds the input", "another folder")
        self.assertEqual(before, sorted((path, path.stat().st_size) for path in self.folder.rglob("*")))

    def test_one_environment_serves_every_verb(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        own = support.environment
        try:
            support.environment = lambda: {**own(), "MAPWEAVE_LASER__ENGINE": "graph", "MAPWEAVE_SEED": "3", "MAPWEAVE_READING__SCAN_RATE_HZ": "3"}
            self.mapweave("convert", "room.log", "room.rawlog")
            self.mapweave("split", "room.log", "--robots", "2", "--out", "logs")
            self.mapweave("slam", "room.log", "--out", "map")
            self.assertIn("seed: 3", (self.folder / "map/config.yaml").read_text())
            support.environment = lambda: {**own(), "MAPWEAVE_LAZER__ENGINE": "graph"}
            for verb in (("convert", "room.log", "other.rawlog"), ("split", "room.log", "--robots", "2", "--out", "other"), ("slam", "room.log", "--out", "other")):
                self.assert_says(self.mapweave(*verb, code=BAD_INPUT), "MAPWEAVE_LAZER")
        finally:
            support.environment = own

    def test_maps_are_given_by_file_or_folder_and_nothing_else(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.mapweave("slam", "room.log", "--out", "map")
        for verb in (("merge", "map"), ("export", "map"), ("export", "map/map.mwdb"), ("export", "map/map.yaml")):
            self.mapweave(*verb, "--out", f"from-{verb[0]}-{pathlib.Path(verb[1]).name}")
        inputs = json.dumps(self.read_json("from-export-map.yaml/manifest.json")["inputs"])
        self.assertIn("map.yaml", inputs)
        self.assertIn("map.pgm", inputs)
        self.assertEqual(json.loads(self.mapweave("inspect", "from-merge-map/team", "--json").stdout)["kind"], "map store")
        for verb in ("merge", "export"):
            self.assert_says(self.mapweave(verb, "absent.mwdb", "--out", "out", code=BAD_INPUT), "absent.mwdb", "check the path")
            self.assert_says(self.mapweave(verb, "room.log", "--out", "out", code=BAD_INPUT), "neither a map store", ".yaml")
            self.assert_says(self.mapweave(verb, "from-merge-map/robots", "--out", "out", code=BAD_INPUT), "without a map.mwdb")

    def test_a_map_that_shows_nothing_is_not_drawn_and_that_is_said(self):
        self.write("one.log", support.carmen_scan(1000.0, [2.0, 81.9, 81.9], 0, 0, 0) + "\n")
        done = self.mapweave("slam", "one.log", "--out", "map")
        self.assertFalse((self.folder / "map/map.png").exists())
        self.assertIn("not drawn", done.stdout)
        self.assertIn("not drawn", " ".join(self.read_json("map/summary.json")["notes"]))

    def test_split_and_export_say_how_they_were_carried_out(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.mapweave("split", "room.log", "--robots", "2", "--at", "1001.1", "--overlap", "0.3", "--out", "logs")
        found = (self.folder / "logs/config.yaml").read_text()
        for words in ("robots: 2", "overlap_s: 0.3", "at_s: [1001.1", "scan_rate_hz"):
            self.assertIn(words, found)
        self.mapweave("slam", "room.log", "--out", "map")
        self.mapweave("export", "map/map.mwdb", "--out", "only", "--pcd")
        found = (self.folder / "only/config.yaml").read_text()
        self.assertIn("pcd: true", found)
        self.assertIn("png: false", found)


class OneRobot(support.Scenario):
    def test_slam_leaves_what_it_promises_and_the_other_verbs_read_it(self):
        log = support.need(support.MALAGA)
        summary = json.loads(self.mapweave("slam", log, "--out", "alpha", "--json").stdout)
        out = self.folder / "alpha"
        self.assertLessEqual(ONE_MAP, names(out))
        robot, = summary["robots"]
        self.assertEqual(robot["scans"], 225)
        for key in ("id", "log_seconds", "wall_seconds", "cpu_seconds", "real_time_factor"):
            self.assertIn(key, robot)
        for key in ("team", "wall_seconds", "peak_rss_bytes", "stages"):
            self.assertIn(key, summary)
        self.assertEqual(summary, self.read_json("alpha/summary.json"))
        self.check_pictures(out)
        self.check_trajectory(out / "trajectory.tum", 225)
        self.check_cloud(out / "map.pcd")

        inspected = json.loads(self.mapweave("inspect", out, "--json").stdout)
        self.assertEqual(inspected["files"]["changed"] + inspected["files"]["missing"], [])
        self.assertEqual(json.loads(self.mapweave("inspect", log, "--json").stdout)["scans"], 225)
        self.mapweave("inspect", out / "map.mwdb")

        self.mapweave("export", out / "map.mwdb", "--out", "exported", "--png", "--pgm", "--pcd", "--tum", "--g2o")
        for name in ("map.pgm", "map.pcd", "trajectory.tum"):
            self.assertEqual((self.folder / "exported" / name).read_bytes(), (out / name).read_bytes(), name)
        self.assertTrue((self.folder / "exported/map.g2o").exists())

        grids = json.loads(self.mapweave("evaluate", "grids", out / "map.yaml", "exported/map.yaml", "--json").stdout)
        self.assertEqual(grids["conflict"], 0)
        same = ("evaluate", "trajectory", "--estimate", out / "trajectory.tum", "--reference", out / "trajectory.tum", "--align", "se2", "--json")
        self.assertLess(json.loads(self.mapweave(*same).stdout)["ate_translation_rmse_m"], 1e-6)
        self.mapweave(*same, "--max", "ate_translation_rmse_m=0.01")
        self.assert_says(self.mapweave(*same, "--max", "pairs=3", code=GATE_FAILED), "pairs")

        # an old result is not overwritten but with --force, and a folder of somebody else's never
        self.assert_says(self.mapweave("slam", log, "--out", "alpha", code=CANNOT_WRITE), "alpha", "--force")
        self.mapweave("slam", log, "--out", "alpha", "--force")
        self.write("letters/dear.txt", "keep me")
        self.mapweave("slam", log, "--out", "letters", "--force", code=CANNOT_WRITE)
        self.assertEqual(names(self.folder / "letters"), {"dear.txt"})

    def check_pictures(self, out):
        for name in ("map.png", "map.color.png"):
            self.assertEqual((out / name).read_bytes()[:8], b"\x89PNG\r\n\x1a\n", name)
        magic, size, depth, cells = (out / "map.pgm").read_bytes().split(b"\n", 3) if b"#" not in (out / "map.pgm").read_bytes()[:40] else self.pgm(out)
        columns, rows = map(int, size.split())
        self.assertEqual((magic, depth, len(cells)), (b"P5", b"255", columns * rows))
        self.assertEqual(set(cells), {0, 205, 254})
        text = (out / "map.yaml").read_text()
        for line in ("image: map.pgm", "occupied_thresh: 0.65", "free_thresh: 0.196", "negate: 0"):
            self.assertIn(line, text)

    def pgm(self, out):
        lines = (out / "map.pgm").read_bytes().split(b"\n", 4)
        return lines[0], lines[2], lines[3], lines[4]

    def check_trajectory(self, path, scans):
        rows = [list(map(float, line.split())) for line in path.read_text().splitlines() if not line.startswith("#")]
        self.assertEqual(len(rows), scans)
        self.assertEqual(rows, sorted(rows, key=lambda row: row[0]))
        for row in rows:
            self.assertEqual(len(row), 8)
            self.assertTrue(all(map(math.isfinite, row)))
            self.assertAlmostEqual(sum(q * q for q in row[4:]), 1.0, places=4)

    def check_cloud(self, path):
        header, _, points = path.read_bytes().partition(b"DATA binary\n")
        fields = dict(line.split(" ", 1) for line in header.decode().splitlines() if " " in line and not line.startswith("#"))
        count = int(fields["POINTS"])
        self.assertGreater(count, 100)
        stride = sum(int(size) * int(number) for size, number in zip(fields["SIZE"].split(), fields["COUNT"].split()))
        self.assertEqual(len(points), count * stride)
        self.assertTrue(all(map(math.isfinite, struct.unpack_from("<3f", points))))


class Team(support.Scenario):
    def test_split_run_and_merge_go_together(self):
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--overlap", "10", "--out", "logs")
        self.assertLessEqual({"robot0.rawlog", "robot1.rawlog"}, names(self.folder / "logs"))
        config = self.configuration([("alpha", "logs/robot0.rawlog", "north"), ("beta", "logs/robot1.rawlog", "south")])
        done = self.mapweave("run", config, "--set", "cloud.thin_maps=false", "--out", "team", "--json", code=(DONE, APART))
        summary, out = json.loads(done.stdout), self.folder / "team"
        self.assertLessEqual({"config.yaml", "manifest.json", "summary.json", "merges.json", "robots", "edges", "team"}, names(out))
        self.assertEqual(names(out / "robots"), {"alpha", "beta"})
        self.assertEqual(names(out / "edges"), {"north", "south"})
        for folder in (out / "robots/alpha", out / "robots/beta", out / "edges/north", out / "edges/south"):
            self.assertLessEqual(OF_A_FOLDER, names(folder))
        self.assertLessEqual(OF_A_FOLDER - {"trajectory.tum"} | {"trajectories"}, names(out / "team"))
        self.assertEqual({robot["id"] for robot in summary["robots"]}, {"alpha", "beta"})
        components = summary["team"]["components"]
        self.assertEqual(done.returncode, DONE if components == 1 else APART)
        self.assertEqual((out / "team-1").exists(), components == 2)
        self.assertEqual([stage["name"] for stage in summary["stages"] if stage["tier"] == "cloud"],
                         ["features", "pairwise matching", "component connection", "transform optimisation", "audit", "composing"])
        members = {"alpha.tum", "beta.tum"} if components == 1 else {"alpha.tum"}
        self.assertLessEqual(members, names(out / "team/trajectories") | {"alpha.tum"})
        for merge in self.read_json("team/merges.json"):
            for key in ("tier", "a", "b", "kind", "accepted", "decision", "reason", "proposer", "probability", "b_from_a", "covariance", "overlap",
                        "conflict", "second_best", "witnesses", "seconds"):
                self.assertIn(key, merge)
            self.assertEqual(merge["accepted"], merge["decision"] == "accepted")

        # the effective configuration, written beside the result, is one that can be run again
        self.mapweave("config", "check", out / "config.yaml")
        # robots' maps kept in stores, each named after its file, merge to the same team
        for name in ("alpha", "beta"):
            shutil.copy(out / f"robots/{name}/map.mwdb", self.folder / f"{name}.mwdb")
        merged = json.loads(self.mapweave("merge", "alpha.mwdb", "beta.mwdb", "--out", "again", "--json", code=(DONE, APART)).stdout)
        self.assertEqual(merged["team"]["components"], components)
        self.assertEqual((self.folder / "again/team/map.pgm").read_bytes(), (out / "team/map.pgm").read_bytes())
        self.assert_says(self.mapweave("merge", "alpha.mwdb", out / "manifest.json", "--out", "twice", code=(USAGE, BAD_INPUT)), "manifest.json")
        self.assert_nothing_left("twice")


class Simulated(support.Scenario):
    def test_a_simulated_team_can_be_run_as_it_comes(self):
        world = self.write("world.yaml", "seed: 3\nrobots:\n  - {id: alpha, length_m: 12}\n  - {id: beta, length_m: 12}\n")
        self.mapweave("simulate", world, "--out", "logs")
        again = self.mapweave("simulate", world, "--out", "logs2", "--json")
        json.loads(again.stdout)
        for path in (self.folder / "logs").glob("*.rawlog"):
            self.assertEqual(path.read_bytes(), (self.folder / "logs2" / path.name).read_bytes(), "the same seed, the same bytes")
        self.assertGreaterEqual(len(list((self.folder / "logs").glob("*.rawlog"))), 2)

    def test_a_team_that_shares_rooms_becomes_one_map(self):
        self.mapweave("simulate", support.ROOT / "configs/worlds/apartment.yaml", "--out", "sim")
        self.mapweave("run", "sim/run.yaml", "--out", "out", code=DONE)
        self.assertEqual(self.read_json("out/summary.json")["team"]["components"], 1)
        self.mapweave("evaluate", "trajectory", "--estimate", "out/team/trajectories/alpha.tum", "--reference", "sim/alpha.truth.tum",
                      "--align", "se2", "--max", "ate_translation_rmse_m=0.05", code=DONE)

    def test_a_carmen_log_is_converted_and_mapped(self):
        self.write("room.log", "\n".join(support.room_lines(40)) + "\n")
        self.mapweave("convert", "room.log", "room.rawlog")
        self.assertEqual(json.loads(self.mapweave("inspect", "room.rawlog", "--json").stdout)["scans"], 40)
        self.mapweave("slam", "room.rawlog", "--out", "room")


if __name__ == "__main__":
    support.main()
