"""Finding one's way: help, options, messages of the command line, and inspect of everything that the program writes."""
import json
import pathlib
import re
import shutil
import tempfile

import support
from support import BAD_INPUT, DONE, USAGE, VERBS

BELOW = {"serve": ("robot", "edge", "cloud", "coordinator", "keys", "demo"), "evaluate": ("relations", "trajectory", "grids", "convert"),
         "vocabulary": ("train", "info"), "config": ("show", "check", "reference")}
EVERY_HELP = [(verb,) for verb in VERBS] + [(verb, below) for verb, all_below in BELOW.items() for below in all_below]


class Help(support.Scenario):
    def test_help_is_there_however_it_is_asked_for(self):
        for verb in EVERY_HELP:
            with self.subTest(" ".join(verb)):
                self.assertEqual(self.mapweave("help", *verb).stdout, self.mapweave(*verb, "--help").stdout)
        self.assertEqual(self.mapweave("help").stdout, self.mapweave("-h").stdout)
        self.assertEqual(self.mapweave("-v").stdout, self.mapweave("--version").stdout)
        self.assertRegex(self.mapweave("-v").stdout, r"^mapweave \S+")

    def test_each_help_shows_an_example_of_its_own(self):
        for verb in EVERY_HELP:
            with self.subTest(" ".join(verb)):
                examples = self.mapweave(*verb, "--help").stdout.split("Example")[1]
                self.assertIn(f"\n  mapweave {' '.join(verb)} ", examples)

    def test_no_help_speaks_the_parsers_language(self):
        for verb in ((), *EVERY_HELP):
            text = self.mapweave(*verb, "--help").stdout
            for word in ("ENUM", "} OR {", "UINT", "REQUIRED", ":INT", ":TEXT", "TEXT:", ", //", "SUBCOMMAND "):
                self.assertNotIn(word, text, verb)
            self.assertLess(max(map(len, text.splitlines())), 140, verb)

    def test_the_help_of_plan_shows_its_format(self):
        text = self.mapweave("plan", "--help").stdout
        problem = re.search(r"PROBLEM.json:\n(\{.*?\}|  \{.*?\})\n\S", text, re.DOTALL).group(1)
        self.write("problem.json", problem)
        placement = json.loads(self.mapweave("plan", "problem.json", "--json").stdout)["placement"]
        self.assertEqual(set(placement), {"r0", "r1", "r2"})
        self.write("wrong.json", "robots: [r0]")
        self.assert_says(self.mapweave("plan", "wrong.json", code=BAD_INPUT), "not JSON", "mapweave plan --help shows what is expected")


class Messages(support.Scenario):
    def says(self, command, *words, code=USAGE):
        with self.subTest(" ".join(command)):
            done = self.mapweave(*command, code=code)
            self.assert_says(done, *words)
            for word in ("not in {", "ENUM", "FAILED", "is required", "Run with", "Could not convert", "subcommand"):
                self.assertNotIn(word, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)

    def test_what_is_wrong_with_a_command_line_is_said_in_our_words(self):
        trajectory = ("evaluate", "trajectory", "a.tum", "b.tum")
        self.says((), "the verb is missing", "mapweave --help")
        self.says(("fly",), "there is no verb 'fly'")
        self.says(("run",), "run: CONFIG is missing", "mapweave run --help")
        self.says(("slam", "a.rawlog"), "slam: --out DIR is missing", "mapweave slam --help")
        self.says(("slam", "a.rawlog", "--out"), "--out needs a value")
        self.says(("slam", "a.rawlog", "--out", "o", "--engine", "grpah"), "--engine: 'grpah' is not one of graph, rbpf or icp; did you mean 'graph'?")
        self.says(("slam", "a.rawlog", "--out", "o", "--trheads", "2"), "there is no option '--trheads'; did you mean '--threads'?")
        self.says(("slam", "a.rawlog", "--ouput", "o"), "there is no option '--ouput'; did you mean '--out'?")
        self.says(("slam", "a.rawlog", "b.rawlog", "--out", "o"), "'b.rawlog' is more than it takes")
        self.says(("slam", "a.rawlog", "--out", "o", "--threads", "many"), "--threads: 'many' is not a whole number in 0..1024")
        self.says((*trajectory, "--align", "sideways"), "--align: 'sideways' is not one of auto, none, se2, se3 or sim3")
        self.says((*trajectory, "--delta-unit", "feet"), "--delta-unit: 'feet' is not one of frames or metres")
        self.says((*trajectory, "--delta", "long"), "--delta: 'long' is not a number")
        self.says(("config",), "show, check or reference", "mapweave config --help")
        self.says(("config", "refrence"), "there is no 'config refrence'", "did you mean 'reference'?")
        self.says(("--log-level", "loud", "inspect", "x"), "--log-level: 'loud' is not one of debug, info, warning or error")

    def test_o_is_out(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.mapweave("slam", "room.log", "-o", "map")
        self.assertTrue((self.folder / "map/map.mwdb").exists())
        self.mapweave("export", "map/map.mwdb", "-o", "exported")
        self.mapweave("report", "map", "-o", "page.html")
        self.assertTrue((self.folder / "page.html").exists())

    def test_run_of_a_log_and_slam_of_a_configuration_say_what_was_meant(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.write("team.yaml", "robots: [{id: alpha, log: room.log}]\n")
        self.mapweave("slam", "room.log", "--out", "map")
        self.mapweave("split", "room.log", "--robots", "2", "--out", "logs")
        self.says(("run", "room.log", "--out", "o"), "room.log: this is a log (CARMEN log)", "mapweave slam room.log --out DIR", "robots: [{id: alpha")
        self.says(("run", "logs", "--out", "o"), "this is a folder", "mapweave run logs/run.yaml --out DIR")
        self.says(("run", "map", "--out", "o"), "this is a folder of results", "map/config.yaml", "mapweave inspect map")
        self.says(("run", "map/map.mwdb", "--out", "o"), "this is a map", "merge or export")
        self.says(("config", "check", "room.log"), "this is a log")
        self.says(("slam", "team.yaml", "--out", "o"), "team.yaml: this is a configuration, not a log", "mapweave run team.yaml --out DIR")
        self.says(("slam", "map/map.yaml", "--out", "o"), "this is a map_server grid", "merge")
        self.says(("slam", "map/map.mwdb", "--out", "o"), "this is a map")
        self.says(("slam", "map", "--out", "o"), "this is a folder of results", "mapweave inspect map")
        self.says(("convert", "team.yaml", "o.rawlog"), "this is a configuration", "one of the logs")

    def test_log_level_error_is_quiet(self):
        self.write("room.log", "\n".join(support.room_lines(12)) + "\n")
        self.assertIn("scans", self.mapweave("slam", "room.log", "--out", "loud").stderr)
        for level in ("warning", "error"):
            done = self.mapweave("--log-level", level, "slam", "room.log", "--out", level)
            self.assertEqual(done.stderr, "")
            self.assertIn("results: ", done.stdout)


class Options(support.Scenario):
    def test_options_are_found_by_a_word(self):
        found = self.mapweave("config", "reference", "--find", "Resolution").stdout
        self.assertIn("compose.resolution_m: 0.05\n    side in metres of a cell of the occupancy grid", found)
        self.assertNotIn("robots", found)
        both = self.mapweave("config", "reference", "--find", "octomap", "--find", "side in metres").stdout
        self.assertEqual([line.split(":")[0] for line in both.splitlines()[::2]], ["output.dense.octomap.resolution_m"])
        self.assertIn("robots.0.edge", self.mapweave("config", "reference", "--find", "the coordinator decides").stdout)
        self.assertIn("people.count", self.mapweave("config", "reference", "--of", "world", "--find", "people").stdout)
        self.assert_says(self.mapweave("config", "reference", "--find", "colour of the walls", code=USAGE), "no option", "colour of the walls")

    def test_a_key_that_resembles_the_last_part_of_another_names_it(self):
        self.write("a.log", "\n".join(support.room_lines(3)) + "\n")
        self.write("team.yaml", "robots: [{log: a.log}]\nresolution: 0.1\n")
        self.assert_says(self.mapweave("config", "check", "team.yaml", code=BAD_INPUT), "team.yaml:2", "unknown key 'resolution'", "did you mean 'compose.resolution_m'")
        self.assert_says(self.mapweave("config", "show", "--set", "merge_probabilty=0.9", code=USAGE), "did you mean 'fusion.merge_probability'?")

    def test_the_ten_options_that_matter_exist_and_are_ten(self):
        page = (support.ROOT / "apps/mapweave/guide/options.md").read_text()
        rows = re.findall(r"^\| `([a-z0-9_.]+)` \|", page, re.MULTILINE)
        self.assertEqual(len(rows), 10)
        known = self.mapweave("config", "reference", "--find", "").stdout
        for key in re.findall(r"`([a-z0-9_]+(?:\.[a-z0-9_]+)+)`", page):
            if not key.endswith((".yaml", ".md")):
                self.assertRegex(known, rf"(?m)^{re.escape(key)}:")
        for key in rows:
            self.assertRegex(known, rf"(?m)^{re.escape(key)}:")

    def test_a_coordinators_robots_are_on_no_edge_without_a_name(self):
        self.write("a.log", "\n".join(support.room_lines(3)) + "\n")
        self.write("b.log", "\n".join(support.room_lines(4)) + "\n")
        self.write("team.yaml", "robots: [{log: a.log}, {log: b.log, edge: south}]\nedges: [{id: north}, {id: south}]\ncoordinator: {method: default}\n")
        text = self.mapweave("config", "check", "team.yaml").stdout
        self.assertNotIn("on edge :", text)
        self.assertIn("robot a, its edge as the coordinator chooses: ", text)
        self.assertIn("robot b on edge south: ", text)


class Inspect(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-"))
        cls.addClassCleanup(shutil.rmtree, cls.world, ignore_errors=True)

    def setUp(self):
        super().setUp()
        shutil.rmtree(self.folder)
        self.folder = self.world    # shared: inspecting changes nothing
        if not (self.folder / "team").exists():
            self.make()

    def make(self):
        rooms = "robots=[{id: alpha, length_m: 6, first_room: 0, last_room: 1}, {id: beta, length_m: 6, first_room: 0, last_room: 1}]"
        self.mapweave("simulate", support.ROOT / "configs/worlds/camera_team.yaml", "--set", rooms, "--set", "logs.layout=both", "--out", "logs")
        every = [part for name in ("g2o", "ply", "octomap") for part in ("--set", f"output.{name}=true")]
        self.mapweave("run", "logs/run.yaml", "--set", "sensor=all", *every, "--out", "team", code=(DONE, support.APART))
        self.mapweave("slam", "logs/alpha_camera", "--set", "output.g2o=true", "--out", "seen")
        self.mapweave("profile", "team", "--out", "model.json")
        self.mapweave("vocabulary", "train", "seen/../logs/alpha_camera", "--branching", "3", "--levels", "2", "--out", "words.txt.gz")
        self.mapweave("evaluate", "convert", "seen/trajectory.tum", "seen.csv")
        self.mapweave("evaluate", "convert", "seen/trajectory.tum", "seen.txt", "--to", "kitti")

    def test_inspect_reads_everything_that_the_program_writes(self):
        files = [path for path in self.folder.rglob("*") if path.is_file() and path.parent.name not in ("rgb", "depth") and "_Images" not in str(path)
                 and "alpha_camera" not in str(path) and "beta_camera" not in str(path)]
        endings = {path.suffix for path in files}
        self.assertLessEqual({".mwdb", ".json", ".yaml", ".tum", ".csv", ".txt", ".g2o", ".pcd", ".ply", ".bt", ".ot", ".png", ".pgm", ".html", ".gz", ".rawlog"}, endings)
        for path in [*files, self.folder / "team", self.folder / "logs", self.folder / "seen", self.folder / "logs/alpha_camera"]:
            with self.subTest(str(path.relative_to(self.folder))):
                self.assertRegex(self.mapweave("inspect", path).stdout, r"^kind: \S")

    def test_a_pair_is_a_line_unless_all_is_wanted(self):
        pairs = len(self.read_json("team/merges.json"))
        self.assertGreater(pairs, 0)
        for path in ("team", "team/merges.json"):
            text = self.mapweave("inspect", path).stdout
            merges = text.split("merges:\n")[1]
            self.assertEqual(len(merges.splitlines()), pairs, merges)
            self.assertIn("alpha + beta: ", merges)
            self.assertIn("    hypotheses:\n", self.mapweave("inspect", path, "--all").stdout)
        self.assertRegex(self.mapweave("inspect", "team").stdout, r"(?m)^ +- alpha: \d+ scans, \d+ frames of \d+ s, edge ")

    def test_a_trajectory_a_configuration_and_a_cloud_say_what_they_hold(self):
        inspected = json.loads(self.mapweave("inspect", "seen/trajectory.tum", "--json").stdout)
        self.assertEqual(inspected["poses"], len((self.folder / "seen/trajectory.tum").read_text().splitlines()))
        self.assertGreater(inspected["length_m"], 3.0)
        self.write("small.yaml", "robots: [{id: alpha, log: logs/alpha.rawlog, edge: north}]\ncompose: {resolution_m: 0.1}\n")
        text = self.mapweave("inspect", "small.yaml").stdout
        self.assertIn("kind: configuration of a run\noptions:\n  compose.resolution_m: 0.1\nrobots:\n  - alpha: logs/alpha.rawlog, edge north\n", text)
        self.assertIn("kind: simulated world", self.mapweave("inspect", "logs/config.yaml").stdout)
        cloud = json.loads(self.mapweave("inspect", "seen/map.pcd", "--json").stdout)
        self.assertGreater(cloud["points"], 100)
        graph = json.loads(self.mapweave("inspect", "seen/map.g2o", "--json").stdout)
        self.assertGreater(graph["edges"], graph["vertices"] // 4)


if __name__ == "__main__":
    support.main()
