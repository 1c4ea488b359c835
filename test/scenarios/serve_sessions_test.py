"""A deployment that begins with the map of another day: a robot that left, and comes again with a new recording."""
import shutil

import serve_test
import support
from option_effect_inputs import FLAT

# Monday's robot drives again on Tuesday, in a flat large enough that no half of it lies on the other half.
LASERS = FLAT.replace("width_m: 8, height_m: 7", "width_m: 12, height_m: 9") + """
laser: {rays: 121, scans_per_second: 3, max_range_m: 8}
robots:
  - {id: monday, first_room: 0, last_room: 2, length_m: 14, laps: 2}
  - {id: tuesday, first_room: 0, last_room: 2, length_m: 14}
"""


class ServeSessions(serve_test.WithBroker):
    def deploy(self, day, broker, *options):
        """Robot alpha with this day's recording, on a machine without the maps of the cloud's."""
        team = "robots: [{id: alpha, edge: north, log: %s.rawlog}]\nedges: [{id: north}]\nlive: {broker: '%s', speed: 0}\n" % (day, broker)
        team += "".join(options)
        self.write(f"robot/{day}.yaml", team)
        shutil.copy(self.folder / f"logs/{day}.rawlog", self.folder / "robot")
        self.write(f"{day}.yaml", team)
        cloud = self.start("serve", "cloud", f"{day}.yaml", "--out", day)
        edge = self.start("serve", "edge", f"{day}.yaml")
        self.end(self.start("serve", "robot", f"robot/{day}.yaml", "--name", "alpha"))
        self.end(cloud)
        self.end(edge)

    def test_a_robot_that_comes_again_the_next_day_joins_its_map(self):
        self.mapweave("simulate", self.write("world.yaml", LASERS), "--out", "logs")
        broker = self.start_broker()
        self.deploy("monday", broker)
        self.deploy("tuesday", broker, "maps: [monday]\n")
        self.assertEqual(self.read_json("tuesday/summary.json")["team"]["members"], [["alpha", "alpha-1"]])
        team = (self.folder / "tuesday.yaml").read_text().replace("log: ", "log: logs/")
        self.mapweave("run", self.write("run.yaml", team), "--out", "run")
        self.assert_same_map("tuesday", "run")

    def test_a_deployment_that_shares_cameras_refuses_maps(self):
        self.write("team.yaml", "robots: [{id: alpha, edge: north, log: a.rawlog}]\nedges: [{id: north}]\nserver: {share: view}\nmaps: [monday]\n")
        refused = self.mapweave("serve", "edge", "team.yaml", code=support.BAD_INPUT)
        self.assertIn("maps of sessions before", refused.stderr)


if __name__ == "__main__":
    support.main()
