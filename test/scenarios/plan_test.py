"""`mapweave plan` and `mapweave profile`: which robot to which edge, from problem files good and bad."""
import json
import random

import support
from support import BAD_INPUT, USAGE

KEYS = ["groups", "placement", "cut_weight", "in_group_weight", "predicted_seconds", "lower_bound_seconds", "algorithm_seconds", "method"]


def problem(robots=10, edges=3, **more):
    numbers = random.Random(robots)
    names = [f"r{i}" for i in range(robots)]
    overlaps = [[a, b, round(numbers.uniform(0.01, 0.5), 3)] for i, a in enumerate(names) for b in names[i + 1:] if numbers.random() < 0.4]
    return {"robots": names, "overlaps": overlaps,
            "edges": [{"id": f"e{i}", "bandwidth_bytes_per_s": 2.5e6, "speed": 1.0, "capacity": None} for i in range(edges)], **more}


class Plan(support.Scenario):
    def plan(self, given, *arguments, **how):
        self.write("problem.json", given if isinstance(given, str) else json.dumps(given))
        return self.mapweave("plan", "problem.json", *arguments, **how)

    def test_every_method_answers_with_the_same_keys(self):
        given = problem(robot_scans={"r0": 1200}, links=[["r1", "e2", 1e6, 0.02]])
        for method in ("default", "recslam", "greedy", "random", "exact"):
            with self.subTest(method):
                plan_json = json.loads(self.plan(given, "--method", method, "--json").stdout)
                self.assertEqual(list(plan_json), KEYS)
                self.assertEqual(plan_json["method"], method)
                self.assertEqual(sorted(robot for group in plan_json["groups"] for robot in group), sorted(given["robots"]))
                self.assertEqual(sorted(map(len, plan_json["groups"])), [3, 3, 4])
                for group in plan_json["groups"]:
                    self.assertEqual(len({plan_json["placement"][robot] for robot in group}), 1)
                inside = {frozenset((a, b)) for group in plan_json["groups"] for a in group for b in group if a != b}
                cut = sum(weight for a, b, weight in given["overlaps"] if frozenset((a, b)) not in inside)
                self.assertAlmostEqual(plan_json["cut_weight"], cut, 9)
                self.assertLessEqual(plan_json["lower_bound_seconds"], plan_json["predicted_seconds"])

    def test_a_run_that_is_there_had_to_be_copied_into_a_problem_by_hand(self):
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--out", "logs")
        config = self.configuration([("alpha", "logs/robot0.rawlog", "north"), ("beta", "logs/robot1.rawlog", "south")])
        self.mapweave("run", config, "--set", "network.robot_edge.profile=wifi", "--set", "edges=[{id: north}, {id: south, capacity: 1}]", "--out", "team")
        plan_json = json.loads(self.mapweave("plan", "team", "--json").stdout)
        self.assertEqual(sorted(plan_json["placement"]), ["alpha", "beta"])
        self.assertEqual(set(plan_json["placement"].values()), {"north", "south"}, "south takes one robot")
        overlaps = self.read_json("team/summary.json")["timeline"]["overlaps"]
        self.assertGreater(overlaps[0][2], 0.0)
        self.assertAlmostEqual(plan_json["cut_weight"], overlaps[0][2], 6)
        done = self.mapweave("plan", "logs", code=BAD_INPUT)
        self.assert_says(done, "summary.json")

    def test_recslam_s_tabu_search_is_chosen_on_the_command_line(self):
        """RecSLAM's fig. 16: with the search the cut is less than without."""
        given = problem(40, 4)
        cuts = {search: json.loads(self.plan(given, "--method", "recslam", "--recslam-search", search, "--json").stdout)["cut_weight"]
                for search in ("none", "printed", "tabu")}
        self.assertLess(cuts["printed"], cuts["none"])
        self.assertLess(cuts["tabu"], cuts["none"])
        none = json.loads(self.plan(given, "--method", "recslam", "--recslam-search", "tabu", "--kappa", "0", "--json").stdout)
        self.assertEqual(none["cut_weight"], cuts["none"])
        rows = {row["method"]: row for row in json.loads(self.plan(given, "--compare", "--json").stdout)["compared"]}
        for search, cut in cuts.items():
            self.assertEqual(rows[f"recslam, search {search}"]["cut_weight"], cut)
        self.assertIn("40 robots are too many", rows["exact"]["not_possible"])
        self.assertLessEqual(rows["default"]["cut_weight"], 1.01 * min(cuts.values()))
        text = self.plan(given, "--compare").stdout
        for word in ("recslam, search tabu", "not possible: 40 robots", "predicted s"):
            self.assertIn(word, text)
        self.assert_says(self.plan(given, "--recslam-search", "best", code=USAGE), "--recslam-search")

    def test_metis_groups_where_the_program_has_it(self):
        done = self.plan(problem(), "--method", "metis", "--json", code=(0, BAD_INPUT))
        if done.returncode == BAD_INPUT:
            self.assert_says(done, "built without METIS")
            self.skipTest("built without METIS")
        plan_json = json.loads(done.stdout)
        self.assertEqual(list(plan_json), KEYS)
        self.assertEqual(plan_json["method"], "metis")
        self.assertEqual(sorted(map(len, plan_json["groups"])), [3, 3, 4])

    def test_the_default_is_near_the_exact_cut(self):
        cuts = {method: json.loads(self.plan(problem(14, 4), "--method", method, "--json").stdout)["cut_weight"] for method in ("default", "exact")}
        self.assertLessEqual(cuts["default"], 1.05 * cuts["exact"])

    def test_the_same_seed_gives_the_same_plan(self):
        plan_json = []
        for _ in range(2):
            plan_json.append(json.loads(self.plan(problem(60, 4), "--seed", "7", "--json").stdout))
            del plan_json[-1]["algorithm_seconds"]
        self.assertEqual(plan_json[0], plan_json[1])

    def test_people_get_words(self):
        text = self.plan(problem()).stdout
        for word in ("10 robots in 3 groups", "e0:", "no plan is below"):
            self.assertIn(word, text)

    def test_partial_offloading_names_further_edges(self):
        plan_json = json.loads(self.plan(problem(), "--edges-per-robot", "2", "--json").stdout)
        for robot, edges in plan_json["further_placement"].items():
            self.assertEqual(len(edges), 1)
            self.assertNotEqual(edges[0], plan_json["placement"][robot])

    def test_sensible_plans_for_odd_problems(self):
        zero = problem()
        zero["overlaps"] = [[a, b, 0] for a, b, _ in zero["overlaps"]]
        apart = problem(6, 2)
        apart["overlaps"] = [["r0", "r3", 0.4], ["r1", "r4", 0.4]]
        for given, groups in ((zero, 3), (apart, 2), (problem(2, 5), 2), (problem(1, 1), 1)):
            for method in ("default", "recslam", "greedy", "random", "exact"):
                with self.subTest(f"{method} {groups}"):
                    self.assertEqual(len(json.loads(self.plan(given, "--method", method, "--json").stdout)["groups"]), groups)

    def test_bad_problems_are_met_with_place_and_remedy(self):
        full = problem(4, 2)
        for edge in full["edges"]:
            edge["capacity"] = 1
        for given, words in ((problem() | {"overlaps": [["r0", "r11", 0.1]]}, ("problem.json", "overlaps[0]", "r11", "did you mean")),
                             (problem() | {"overlaps": [["r0", "r1", -0.1]]}, ("overlaps[0]", "-0.1")),
                             ('{"robots": ["a", "b"], "overlaps": [["a", "b", NaN]], "edges": []}', ("problem.json", "not json")),
                             (problem() | {"edges": []}, ("edges", "no edges")), (full, ("capacities hold 2 of 4",)),
                             (problem(robot_scan={}), ("robot_scan", "did you mean 'robot_scans'?")), ("", ("problem.json", "not json")),
                             ("[" * 100000, ("problem.json",))):
            with self.subTest(words[-1]):
                self.assert_says(self.plan(given, code=BAD_INPUT), *words)
        self.assert_says(self.plan(problem(17), "--method", "exact", code=BAD_INPUT), "17 robots", "--method exact")
        self.assert_says(self.mapweave("plan", "absent.json", code=BAD_INPUT), "absent.json")
        self.assert_says(self.plan(problem(), "--method", "best", code=USAGE), "--method")
        self.write("model.json", '{"slam_s_per_scan": -1}')
        self.assert_says(self.plan(problem(), "--model", "model.json", code=BAD_INPUT), "model.json", "slam_s_per_scan")


class Profile(support.Scenario):
    def test_a_run_is_profiled_and_planned_with(self):
        self.write("room.log", "\n".join(support.room_lines(40)) + "\n")
        self.mapweave("split", "room.log", "--robots", "2", "--overlap", "1", "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "map", code=(0, 4))
        plan_json = json.loads(self.mapweave("profile", "map", "--out", "model.json", "--json").stdout)
        self.assertGreater(plan_json["model"]["slam_s_per_scan"], 0)
        terms = {term["term"]: term for term in plan_json["terms"]}
        self.assertIn("what edges send", terms)
        self.assertGreater(plan_json["model"]["edge_bytes_per_map_byte"], 0)
        # Two robots and one coefficient leave a degree of freedom for an interval; one edge leaves none.
        self.assertEqual(terms["SLAM"]["samples"], 2)
        for point in terms["SLAM"]["points"]:
            self.assertGreater(point["half_width"], 0)
        self.assertEqual([point["half_width"] for point in terms["fusion on an edge"]["points"]], [None])
        self.write("problem.json", json.dumps(problem()))
        self.mapweave("plan", "problem.json", "--model", "model.json")
        self.assertIn("SLAM", self.mapweave("profile", "map").stdout)
        # A coordinator predicts with it; and what would have been over slow wires?
        self.mapweave("run", "logs/run.yaml", "--out", "led", "--set", "coordinator.method=default", "--set", "coordinator.model=model.json",
                      "--set", "edges=[{id: north}, {id: south}]", code=(0, 4))
        summary = self.read_json("led/summary.json")
        self.assertGreater(summary["coordinator"]["expected_seconds"], 0)
        as_it_was = json.loads(self.mapweave("timeline", "led", "--json").stdout)
        self.assertEqual(as_it_was["total_seconds"], summary["timeline"]["total_seconds"])
        self.assertEqual(as_it_was["overlaps"], summary["timeline"]["overlaps"])
        for one, other, degree in as_it_was["overlaps"]:
            self.assertLess(one, other)
            self.assertTrue(0.0 < degree <= 0.5, degree)
        self.assertTrue(as_it_was["overlaps"], "robots of one log that overlap share ground")
        slow = json.loads(self.mapweave("timeline", "led", "--set", "network.robot_edge.bytes_per_s=1000", "--json").stdout)
        self.assertGreater(slow["total_seconds"], as_it_was["total_seconds"] + 1)
        self.assertIn("robot robot0", self.mapweave("timeline", "led").stdout)
        self.assert_says(self.mapweave("timeline", "led", "--set", "mode=cloud-only", code=USAGE), "run it again")
        for setting in ("fusion.visual.enough_witnesses=3", "coordinator.method=none", "cloud.edges_judge=false", "edges.0.speed=2", "networks=1"):
            self.assert_says(self.mapweave("timeline", "led", "--set", setting, code=USAGE), setting.split("=")[0], "does not act")
        for setting in ("mode=onboard", "cloud.at=north", "processors.edge=2", "seed=3"):
            self.mapweave("timeline", "led", "--set", setting)
        damaged = dict(summary, timeline=dict(summary["timeline"], overlaps=[["robot0", "robot1"]]))
        self.write("led/summary.json", json.dumps(damaged))
        self.assert_says(self.mapweave("timeline", "led", code=BAD_INPUT), "timeline.overlaps", "two robots and their overlap degree")
        self.assert_says(self.mapweave("profile", "led", code=BAD_INPUT), "timeline.overlaps", "two robots and their overlap degree")
        self.write("led/summary.json", '{"timeline": {"robots": 3}}')
        self.assert_says(self.mapweave("timeline", "led", code=BAD_INPUT), "led/summary.json", "timeline.robots")

    def test_a_run_that_mapped_on_board_has_no_times_of_offloading(self):
        self.write("room.log", "\n".join(support.room_lines(40)) + "\n")
        self.mapweave("split", "room.log", "--robots", "2", "--overlap", "1", "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "map", "--set", "mode=onboard", code=(0, 4))
        self.assert_says(self.mapweave("timeline", "map", "--set", "mode=offload", code=USAGE), "not measured", "run it again with --set mode=offload")
        self.mapweave("timeline", "map", "--set", "mode=onboard")

    def test_a_folder_without_results_is_refused(self):
        self.assert_says(self.mapweave("profile", "nowhere", code=BAD_INPUT), "summary.json")


if __name__ == "__main__":
    support.main()
