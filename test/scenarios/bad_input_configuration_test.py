"""Configurations that cannot be meant: the message names file and line, exit code 3, nothing is written."""
import support
from option_effect_inputs import WORLDS
from support import BAD_INPUT, USAGE


class BadConfiguration(support.Scenario):
    def setUp(self):
        super().setUp()
        lines = "\n".join(support.room_lines(10)) + "\n"
        self.write("a.log", lines)
        self.write("b.log", lines)

    def refuse(self, text, *words):
        config = self.write("team.yaml", text)
        self.assert_says(self.mapweave("run", config, "--out", "out", code=BAD_INPUT), *words)
        self.assert_says(self.mapweave("config", "check", config, code=BAD_INPUT), *words)
        self.assert_nothing_left("out")

    def test_two_robots_with_one_id(self):
        self.refuse("robots:\n  - {id: alpha, log: a.log}\n  - {id: alpha, log: b.log}\n", "team.yaml:3", "alpha", "two robots")

    def test_an_edge_that_no_robot_uses(self):
        self.refuse("robots:\n  - {id: alpha, log: a.log, edge: north}\nedges:\n  - {id: north}\n  - {id: south}\n", "team.yaml:5", "south")

    def test_a_log_that_is_not_there(self):
        self.refuse("robots:\n  - {id: alpha, log: a.log}\n  - {id: beta, log: lost.log}\n", "team.yaml:3", "lost.log")

    def test_no_robots_at_all(self):
        self.refuse("laser: {engine: graph}\n", "robots")
        self.refuse("", "robots")

    def test_names_that_cannot_be_folders(self):
        self.refuse("robots:\n  - {id: ../../etc, log: a.log}\n", "team.yaml:2", "../../etc")

    def test_values_out_of_range_and_unknown_engines(self):
        self.refuse("robots:\n  - {id: alpha, log: a.log}\nlaser: {engine: magic}\n", "team.yaml:3", "magic", "graph")

    def test_robots_to_be_refused_that_are_none(self):
        two = "robots:\n  - {id: alpha, log: a.log}\n  - {id: beta, log: b.log}\n"
        self.refuse(two + "team: {refuse: [alpha, beta]}\n", "team.yaml:4", "'alpha' is no pair of names", '["alpha,beta"]')
        self.refuse(two + 'team: {refuse: ["alpha,betta"]}\n', "team.yaml:4", "unknown robot 'betta'", "did you mean 'beta'?")
        config = self.write("team.yaml", two)
        for pair, words in (("alpha", "--refuse alpha,beta"), ("alpha,alpha", "are one robot"), ("alpha,gamma", "the configuration has: alpha, beta")):
            self.assert_says(self.mapweave("run", config, "--refuse", pair, "--out", "out", code=USAGE), "--refuse", words)
            self.assert_nothing_left("out")

    def test_two_robots_with_contradictory_options(self):
        self.refuse("robots:\n  - {id: alpha, log: a.log}\n  - {id: beta, log: b.log, visual: {vocabulary: words.gz}}\n",
                    "team.yaml:3", "robot 'beta' has a vocabulary of its own", "robot 'alpha'", "set visual.vocabulary for all")

    def test_two_robots_of_one_map_server_with_contradictory_options(self):
        self.write("world.yaml", WORLDS["cameras"].replace("length_m: 6", "length_m: 1").replace("length_m: 5", "length_m: 1"))
        self.mapweave("simulate", "world.yaml", "--out", "world")
        robots = "robots:\n  - {id: alpha, log: world/alpha.rawlog, edge: one, %s}\n  - {id: beta, log: world/beta.rawlog, edge: one, %s}\n"
        waits = "visual: {session: {await_place: true}}"
        for sensor, alpha, beta, words in (
                ("rgbd", "rig: {enabled: true}", "rig: {enabled: false}",
                 ("team.yaml:2", "'alpha' and 'beta' have different options of rig", "edge 'one'", "set rig for all robots")),
                ("mono", waits, waits, ("team.yaml:2", "'alpha' and 'beta' of edge 'one' wait for each other's maps", "await_place: false"))):
            share = f"sensor: {sensor}\nserver: {{share: view, across_edges: false}}\n"
            config = self.write("team.yaml", robots % (alpha, beta) + share)
            self.assert_says(self.mapweave("run", config, "--out", "out", code=BAD_INPUT), *words)
            self.assert_nothing_left("out")
        # One of each is no contradiction: each maps for itself, and the results say what that means.
        done = self.mapweave("run", self.write("team.yaml", robots % ("sensor: laser", "sensor: rgbd")), "--out", "apart", code=support.APART)
        self.assertRegex(done.stdout, "robot alpha maps with its laser, robot beta with cameras: .* stay apart; map all robots with the same")

    def test_text_that_is_no_yaml(self):
        self.refuse("robots: [{id: alpha, log: a.log\n", "team.yaml")
        self.refuse("robots: 7\n", "team.yaml:1", "robots")

    def test_a_configuration_that_is_not_there(self):
        self.assert_says(self.mapweave("run", "lost.yaml", "--out", "out", code=(BAD_INPUT, USAGE)), "lost.yaml")
        self.assert_nothing_left("out")


if __name__ == "__main__":
    support.main()
