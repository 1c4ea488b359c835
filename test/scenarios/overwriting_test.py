"""Files that a command line named as output, and that were something else: each case destroyed a file, and ended well."""
import shutil

import support
from support import BAD_INPUT, USAGE


def trajectory(x, y, count=40):
    """A drive along x, with stamps that begin at 1."""
    return "".join(f"{1 + 0.5 * i} {x + 0.1 * i} {y} 0 0 0 0 1\n" for i in range(count))


class Outputs(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.made = support.pathlib.Path(support.tempfile.mkdtemp(prefix="mapweave-scenario-"))
        cls.addClassCleanup(shutil.rmtree, cls.made, ignore_errors=True)
        (cls.made / "room.log").write_text("\n".join(support.room_lines(40)) + "\n")
        (cls.made / "hall.log").write_text("\n".join(support.room_lines(20)) + "\n")
        (cls.made / "run.yaml").write_text("robots: [{id: alpha, log: room.log}, {id: beta, log: hall.log}]\n")
        support.subprocess.run([support.PROGRAM, "run", "run.yaml", "--out", "results"], cwd=cls.made, env=support.environment(), capture_output=True, check=False)

    def setUp(self):
        super().setUp()
        shutil.copytree(self.made / "results", self.folder / "results")
        self.write("reference.tum", trajectory(0, 0))

    def assert_kept(self, path, *arguments):
        before = (self.folder / path).read_bytes()
        done = self.mapweave(*arguments, code=USAGE)
        self.assertEqual((self.folder / path).read_bytes(), before, path)
        self.assert_says(done, "nothing was written", path)

    def test_inputs_and_results_are_kept(self):
        self.assert_kept("reference.tum", "evaluate", "trajectory", "reference.tum", "reference.tum", "--plot", "reference.tum")
        self.assert_kept("reference.tum", "report", "results", "--reference", "reference.tum", "--out", "reference.tum")
        self.assert_kept("results/summary.json", "report", "results", "--out", "results/summary.json")
        self.assert_kept("results/config.yaml", "plan", "results", "--report", "results/config.yaml")
        self.assert_kept("results/manifest.json", "profile", "results", "--out", "results/manifest.json")
        self.assert_kept("results/merges.json", "explain", "results", "alpha", "beta", "--out", "results/merges.json")
        self.assert_kept("results/robots/alpha/map.png", "explain", "results", "alpha", "beta", "--out", "results/robots/alpha/map.png")
        self.assert_kept("reference.tum", "evaluate", "convert", "reference.tum", "reference.tum", "--to", "kitti")

    def test_an_earlier_file_of_the_kind_is_replaced(self):
        for _ in range(2):
            self.mapweave("report", "results")
            self.mapweave("report", "results", "--out", "page.html")
            self.mapweave("evaluate", "trajectory", "reference.tum", "reference.tum", "--align", "none", "--plot", "plot.png")
            self.mapweave("explain", "results", "alpha", "beta")


class Robots(support.Scenario):
    def test_that_drove_at_the_same_time_are_not_judged_by_one_file(self):
        for name, y in (("alpha", 0.0), ("beta", 4.0)):
            (self.folder / "team").mkdir(exist_ok=True)
            self.write(f"team/{name}.tum", trajectory(0.0, y))
        for name in ("alpha", "all"):
            self.write(f"{name}.truth.tum", trajectory(0.0, 0.0))
            self.write(f"{name}.relations", "1 2 0.2 0 0 0 0 0\n")
        # It is that of the robot after which it is called: beta, 4 m aside, is not judged by it.
        done = self.mapweave("evaluate", "trajectory", "team", "alpha.truth.tum", "--align", "none", "--max", "ate_translation_max_m=0.001")
        self.assertIn("alpha.truth.tum is taken for that of robot alpha", done.stderr)
        self.assertIn("is taken for that of robot alpha", self.mapweave("evaluate", "relations", "team", "alpha.relations").stderr)
        for judge, reference in (("trajectory", "all.truth.tum"), ("relations", "all.relations")):
            done = self.mapweave("evaluate", judge, "team", reference, code=BAD_INPUT)
            self.assert_says(done, "alpha and beta drove at the same time", "a folder with a file for each robot")
        # One after the other, as of a log that was cut, one file is right.
        self.write("team/beta.tum", "".join(f"{100 + 0.5 * i} {0.1 * i} 4 0 0 0 0 1\n" for i in range(40)))
        self.mapweave("evaluate", "relations", "team", "all.relations")


class CommandLine(support.Scenario):
    def test_an_option_given_twice_was_called_one_without_a_value(self):
        self.write("room.log", "\n".join(support.room_lines(5)) + "\n")
        done = self.mapweave("slam", "room.log", "--out", "a", "--out", "b", code=USAGE)
        self.assert_says(done, "--out is given twice")

    def test_help_may_follow_the_programs_own_flags(self):
        self.assertIn("--engine", self.mapweave("--log-level", "warning", "help", "slam").stdout)

    def test_plan_prints_the_further_edges(self):
        self.write("problem.json", '{"robots": ["a", "b", "c"], "overlaps": [["a", "b", 0.3], ["b", "c", 0.2]], "edges": [{"id": "e0", "bandwidth_bytes_per_s": 1e6}, {"id": "e1", "bandwidth_bytes_per_s": 1e6}]}')
        done = self.mapweave("plan", "problem.json", "--edges-per-robot", "2")
        for robot in "abc":
            self.assertIn(f"{robot} also to e", done.stdout)


if __name__ == "__main__":
    support.main()
