"""Runs that begin with the maps of sessions before: one flat mapped again and again, in the frame of the first session."""
import json
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import support
from option_effect_inputs import FLAT, camera

# Large enough that no half of it lies on the other half.
LASERS = FLAT.replace("width_m: 8, height_m: 7", "width_m: 12, height_m: 9") + """
laser: {rays: 121, scans_per_second: 3, max_range_m: 8}
robots:
  - {id: monday, first_room: 0, last_room: 2, length_m: 14, laps: 2}
  - {id: tuesday, first_room: 0, last_room: 2, length_m: 14}
  - {id: wednesday, first_room: 1, length_m: 12}
"""
# As much to see as a camera needs that is never to be lost.
CAMERAS = FLAT.replace("width_m: 8", "width_m: 9").replace("posters_per_10_m: 3", "posters_per_10_m: 8") + f"""
cameras: [{camera("camera", "rgbd")}]
laser: {{rays: 61, scans_per_second: 2}}
robots:
  - {{id: monday, first_room: 0, last_room: 2, length_m: 8}}
  - {{id: tuesday, first_room: 0, last_room: 1, length_m: 6}}
  - {{id: wednesday, first_room: 0, last_room: 1, length_m: 6}}
"""
ELSEWHERE = """
seed: 19
buildings: [{kind: ring, seed: 19, ring: {width_m: 12, height_m: 9, corridor_width_m: 1.6, doors: 5, clutter: 5}}]
laser: {rays: 121, scans_per_second: 3, max_range_m: 8}
robots: [{id: far, length_m: 14}]
"""
MONO = FLAT + f"""
logs: {{scans: false}}
cameras: [{camera("camera", "mono", 12, 320)}]
robots: [{{id: single, length_m: 5}}]
"""


def poses(path):
    return {line.split(" ", 1)[0]: line.split(" ", 1)[1] for line in path.read_text().splitlines() if line and line[0] != "#"}


class Sessions(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.worlds = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-"))
        cls.addClassCleanup(shutil.rmtree, cls.worlds, ignore_errors=True)
        for name, world in (("lasers", LASERS), ("cameras", CAMERAS), ("elsewhere", ELSEWHERE), ("mono", MONO)):
            (cls.worlds / f"{name}.yaml").write_text(world)
            subprocess.run([support.PROGRAM, "simulate", cls.worlds / f"{name}.yaml", "--out", cls.worlds / name],
                           env=support.environment(), capture_output=True, check=True)
        cls.monday = cls.worlds / "monday"
        subprocess.run([support.PROGRAM, "slam", cls.log("monday"), "--robot", "alpha", "--out", cls.monday], env=support.environment(),
                       capture_output=True, check=True)

    @classmethod
    def log(cls, day, world="lasers"):
        return cls.worlds / world / f"{day}.rawlog"

    def error_m(self, estimates, world="lasers"):
        """Of all days in one alignment: their stamps are moved apart."""
        texts = {"estimate": "", "truth": ""}
        for number, (day, path) in enumerate(estimates.items()):
            for name, file in (("estimate", self.folder / path), ("truth", self.worlds / world / f"{day}.truth.tum")):
                for stamp, pose in poses(file).items():
                    texts[name] += f"{float(stamp) + 10000.0 * number:.6f} {pose}\n"
        for name, text in texts.items():
            self.write(f"{name}.tum", text)
        done = self.mapweave("evaluate", "trajectory", "--estimate", "estimate.tum", "--reference", "truth.tum", "--align", "se3", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def assert_same_frame(self, path, first):
        """To the last digit: the first place of the first session lies where it lay."""
        begin = min(poses(first), key=float)
        self.assertEqual(poses(self.folder / path)[begin], poses(first)[begin])

    def test_three_sessions_of_one_robot_in_the_frame_of_the_first(self):
        done = self.mapweave("slam", self.log("tuesday"), "--robot", "alpha", "--map", self.monday, "--out", "two")
        self.assertIn("'alpha-1'", done.stdout)
        self.assert_same_frame("two/trajectories/alpha-1.tum", self.monday / "trajectory.tum")
        self.assertEqual((self.folder / "two/trajectory.tum").read_bytes(), (self.folder / "two/trajectories/alpha.tum").read_bytes())
        self.assertLess(self.error_m({"monday": "two/trajectories/alpha-1.tum", "tuesday": "two/trajectory.tum"}), 0.1)

        self.mapweave("slam", self.log("wednesday"), "--robot", "alpha", "--map", "two", "--out", "three")
        days = {"monday": "alpha-1", "tuesday": "alpha-2", "wednesday": "alpha"}
        self.assert_same_frame("three/trajectories/alpha-1.tum", self.monday / "trajectory.tum")
        self.assertLess(self.error_m({day: f"three/trajectories/{robot}.tum" for day, robot in days.items()}), 0.1)
        [frame] = self.read_json("three/summary.json")["team"]["frames"]
        self.assertEqual(frame["kept_by"], "alpha-1")
        self.assertEqual(self.read_json("three/summary.json")["team"]["members"], [["alpha", "alpha-1", "alpha-2"]])

    def test_a_run_begins_with_maps_that_its_file_names(self):
        self.write("run/team.yaml", f"maps: [{self.monday}]\nrobots:\n"
                   + "".join(f"  - {{id: {day}, log: {json.dumps(str(self.log(day)))}}}\n" for day in ("tuesday", "wednesday")))
        for threads in (1, 2):
            self.mapweave("run", "run/team.yaml", "--threads", threads, "--out", f"team{threads}")
        for name in ("team/map.mwdb", "team/trajectories/tuesday.tum", "team/trajectories/alpha.tum", "team/map.pgm"):
            self.assertEqual((self.folder / "team1" / name).read_bytes(), (self.folder / "team2" / name).read_bytes(), name)
        self.assert_same_frame("team1/team/trajectories/alpha.tum", self.monday / "trajectory.tum")
        self.assertEqual(self.read_json("team1/summary.json")["team"]["members"], [["alpha", "tuesday", "wednesday"]])
        # As merging afterwards: the maps join as maps of robots do.
        self.mapweave("merge", self.monday, "team1/robots/tuesday", "team1/robots/wednesday", "--out", "merged")
        days = {"tuesday": "tuesday", "wednesday": "wednesday"}
        errors = [self.error_m({day: f"{out}/team/trajectories/{day}.tum" for day in days}) for out in ("team1", "merged")]
        self.assertLess(errors[0], 1.1 * errors[1] + 0.01)
        # Undone again.
        self.mapweave("merge", "team1", "--without", "alpha", "--out", "undone", code=(support.DONE, support.APART))
        self.assertEqual(sorted(sum(self.read_json("undone/summary.json")["team"]["members"], [])), ["tuesday", "wednesday"])

    def test_the_map_of_another_building_stays_apart(self):
        self.mapweave("slam", self.log("far", "elsewhere"), "--out", "far")
        done = self.mapweave("slam", self.log("tuesday"), "--map", "far", "--out", "two", code=support.APART)
        self.assertIn("stayed apart from the maps that the run began with", done.stdout)
        self.assertRegex(done.stdout, r"far \+ tuesday: (kept apart|not decided): ")
        self.mapweave("slam", self.log("tuesday"), "--out", "alone")
        self.assertEqual((self.folder / "two/trajectory.tum").read_bytes(), (self.folder / "alone/trajectory.tum").read_bytes())
        team = self.configuration([("tuesday", self.log("tuesday"))])
        self.mapweave("run", team, "--map", "far", "--out", "run", code=support.APART)
        self.assertEqual(sorted(map(tuple, self.read_json("run/summary.json")["team"]["members"])), [("far",), ("tuesday",)])

    def test_a_robot_goes_on_with_the_map_that_the_cloud_sent_it(self):
        team = self.configuration([(day, self.log(day)) for day in ("monday", "tuesday")])
        done = self.mapweave("run", team, "--set", "cloud.push_to=[tuesday]", "--out", "first")
        self.assertIn("--map first/robots/tuesday", done.stdout)
        [push] = self.read_json("first/summary.json")["timeline"]["pushes"]
        self.assertEqual((push["robot"], push["next_run"]), ("tuesday", "robots/tuesday/next_run.yaml"))
        self.assertGreater(push["bytes"], 1000)
        before = self.folder / "first/team/trajectories"
        for start in ("first/robots/tuesday", "first/robots/tuesday/next_run.yaml"):
            self.mapweave("slam", self.log("wednesday"), "--robot", "tuesday", "--map", start, "--out", "second", "--force")
            self.assert_same_frame("second/trajectories/monday.tum", before / "monday.tum")
            days = {"monday": "monday", "tuesday": "tuesday-1", "wednesday": "tuesday"}
            self.assertLess(self.error_m({day: f"second/trajectories/{robot}.tum" for day, robot in days.items()}), 0.1)
        # The file is the beginning of a configuration.
        robots = "robots=[{id: tuesday, log: " + str(self.log("wednesday")) + "}]"
        self.mapweave("run", "first/robots/tuesday/next_run.yaml", "--set", robots, "--set", "cloud.push_to=[tuesday]", "--out", "again")
        self.assert_same_frame("again/team/trajectories/monday.tum", before / "monday.tum")
        self.mapweave("slam", self.log("monday"), "--robot", "tuesday", "--map", "again/robots/tuesday", "--out", "third",
                      code=(support.DONE, support.APART))   # the same recording as one of the map: told, not joined twice
        done = self.mapweave("run", team, "--set", "cloud.push_to=[sunday]", "--out", "no", code=support.BAD_INPUT)
        self.assert_says(done, "unknown robot 'sunday'", "monday, tuesday")

    def test_cameras_borrow_from_the_map_and_join_it(self):
        first = ("--robot", "alpha", "--set", "sensor=rgbd")
        self.mapweave("slam", self.log("monday", "cameras"), *first, "--out", "one")
        share = (*first, "--set", "server.share=view")
        for threads in (1, 2):
            self.mapweave("slam", self.log("tuesday", "cameras"), *share, "--map", "one", "--threads", threads, "--out", f"two{threads}")
        for name in ("map.mwdb", "trajectory.tum", "trajectories/alpha-1.tum"):
            self.assertEqual((self.folder / "two1" / name).read_bytes(), (self.folder / "two2" / name).read_bytes(), name)
        [robot] = self.read_json("two1/summary.json")["robots"]
        self.assertGreater(robot["cameras"][0]["heard_bytes"], 0)
        self.assertGreater(robot["cameras"][0]["borrowed_landmarks"], 0)
        self.assert_same_frame("two1/trajectories/alpha-1.tum", self.folder / "one/keyframes.tum")
        frames = robot["cameras"][0]["tracked"]
        self.assertGreater(len(poses(self.folder / "two1/trajectory.tum")), 0.9 * frames, "every frame, not keyframes alone")

        self.mapweave("run", self.configuration([("alpha", self.log("wednesday", "cameras"))]), "--set", "sensor=rgbd", "--set",
                      "server.share=full", "--map", "two1", "--out", "three")
        self.assert_same_frame("three/team/trajectories/alpha-1.tum", self.folder / "one/keyframes.tum")
        days = {"tuesday": "alpha-2", "wednesday": "alpha"}
        self.assertLess(self.error_m({day: f"three/team/trajectories/{robot}.tum" for day, robot in days.items()}, "cameras"), 0.08)

    def test_what_is_no_start_is_refused(self):
        slam = ("slam", self.log("tuesday"), "--out", "no")
        self.write("cut.mwdb", "nothing")
        self.write("map.txt", "nothing")
        store = self.monday / "map.mwdb"
        (self.folder / "damaged.mwdb").write_bytes(store.read_bytes()[:-5000] + bytes(5000))
        for maps, words in (((self.folder / "none.mwdb",), ("there is no map", "none.mwdb")),
                            ((self.folder / "cut.mwdb",), ("cut.mwdb",)),
                            ((self.folder / "damaged.mwdb",), ("damaged.mwdb",)),
                            ((self.folder / "map.txt",), ("map.txt", "map store")),
                            ((self.worlds / "lasers",), ("folder without a map",)),
                            ((self.monday / "map.yaml",), ("map_server grid", "merge")),
                            ((self.monday, store), ("given twice",))):
            flags = [word for path in maps for word in ("--map", path)]
            done = self.mapweave(*slam, *flags, code=(support.BAD_INPUT, support.USAGE))
            self.assert_says(done, *words)
        self.write("team.yaml", f"maps: [none.mwdb]\nrobots: [{{log: {json.dumps(str(self.log('tuesday')))}}}]\n")
        self.assert_says(self.mapweave("run", "team.yaml", "--out", "no", code=support.BAD_INPUT), "none.mwdb", "team.yaml:1")
        done = self.mapweave("slam", self.log("tuesday", "cameras"), "--set", "sensor=rgbd", "--map", self.monday, "--out", "no",
                             code=support.BAD_INPUT)
        self.assert_says(done, "no map of a camera", "sensor: laser")
        self.mapweave("slam", self.log("single", "mono"), "--set", "sensor=mono", "--out", "mono")
        done = self.mapweave("slam", self.log("tuesday", "cameras"), "--set", "sensor=rgbd", "--map", "mono", "--out", "no",
                             code=support.BAD_INPUT)
        self.assert_says(done, "no unit of length", "depth camera")
        done = self.mapweave("slam", self.log("tuesday"), "--map", self.monday, "--out", self.monday, "--force", code=support.USAGE)
        self.assert_says(done, "would be lost")
        self.assert_nothing_left("no")


if __name__ == "__main__":
    support.main()
