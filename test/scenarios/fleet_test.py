"""A fleet whose map goes on from day to day: where it lies, by what number it is known, and who shares what with whom."""
import math

import support
from support import APART, DONE


def first_pose(path):
    _, x, y, _, _, _, qz, qw = map(float, path.read_text().splitlines()[0].split())
    return x, y, 2.0 * math.atan2(qz, qw)


def keys_of(path):
    return dict(line.split(": ", 1) for line in path.read_text().splitlines())


class Fleet(support.Scenario):
    def map_two(self):
        """Yesterday's robot, and today's, whose name comes first."""
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--out", "logs")
        for robot, log in (("zeta", "robot1"), ("alpha", "robot0")):
            self.mapweave("slam", f"logs/{log}.rawlog", "--robot", robot, "--out", robot)

    def assert_same_pose(self, one, other):
        for a, b in zip(first_pose(self.folder / one), first_pose(self.folder / other)):
            self.assertAlmostEqual(a, b, delta=5e-4)

    def test_merging_a_robot_into_yesterdays_map_moved_every_goal(self):
        self.map_two()
        done = self.mapweave("merge", "zeta/map.mwdb", "alpha/map.mwdb", "--out", "today")
        self.assertIn("team: the frame is that of zeta", done.stdout)
        self.assert_same_pose("today/team/trajectories/zeta.tum", "zeta/trajectory.tum")

        # The map goes on, under its id; tomorrow's robots change nothing of where it lies.
        yesterday, today = (keys_of(self.folder / name / "map.yaml") for name in ("zeta", "today/team"))
        self.assertEqual((yesterday["map_version"], today["map_version"]), ('"1"', '"2"'))
        self.assertEqual(yesterday["map_id"], today["map_id"])
        self.assertNotEqual(yesterday["content_hash"], today["content_hash"])
        self.mapweave("merge", "today", "--out", "tomorrow")
        self.assert_same_pose("tomorrow/team/trajectories/zeta.tum", "zeta/trajectory.tum")
        manifest = self.read_json("tomorrow/manifest.json")["maps"]["team/map.mwdb"]
        self.assertEqual((manifest["map_id"], manifest["map_version"]), (today["map_id"].strip('"'), "3"))
        self.mapweave("export", "today/team/map.mwdb", "--pgm", "--out", "served")
        self.assertEqual(keys_of(self.folder / "served/map.yaml")["map_id"], today["map_id"])
        self.assertEqual(self.mapweave("inspect", "served/map.yaml").stderr, "", "its keys are known")

        # Another frame is asked for by a name, by the walls, or by numbers.
        self.mapweave("merge", "zeta/map.mwdb", "alpha/map.mwdb", "--frame", "alpha", "--out", "named")
        self.assert_same_pose("named/team/trajectories/alpha.tum", "alpha/trajectory.tum")
        self.assertIn("axes along the walls", self.mapweave("merge", "today", "--frame", "walls", "--out", "walls").stdout)
        self.mapweave("merge", "today", "--frame", "-2,0.5,0", "--out", "numbers")
        x, y, _ = first_pose(self.folder / "numbers/team/trajectories/zeta.tum")
        before = first_pose(self.folder / "zeta/trajectory.tum")
        self.assertAlmostEqual(x - before[0], -2.0, delta=5e-4)
        self.assertAlmostEqual(y - before[1], 0.5, delta=5e-4)
        frame = self.read_json("numbers/summary.json")["team"]["frames"][0]
        self.assertEqual(frame["team_from_given"], {"x": -2.0, "y": 0.5, "yaw": 0.0})
        self.assertEqual(set(frame["team_from_maps"]), {"alpha", "zeta"})
        done = self.mapweave("merge", "zeta/map.mwdb", "alpha/map.mwdb", "--frame", "zetta", "--out", "wrong", code=support.USAGE)
        self.assert_says(done, "zetta", "did you mean 'zeta'?")
        self.assert_nothing_left("wrong")

    def test_cameras_of_two_edges_share_through_the_cloud(self):
        self.mapweave("simulate", support.ROOT / "configs/worlds/camera_team.yaml", "--set", "robots.0.length_m=10",
                      "--set", "robots.1.length_m=10", "--out", "world")
        flags = ("--set", "sensor=rgbd", "--set", "server.share=view")
        done = self.mapweave("run", "world/run.yaml", *flags, "--set", "server.across_edges=false", "--out", "apart",
                             code=(DONE, APART))
        self.assertIn("note: server.share=view has no effect: cameras of different edges share nothing", done.stdout)
        self.assertIn("edge0: alpha; edge1: beta", done.stdout)
        self.assertNotIn("sharing", self.read_json("apart/summary.json"))
        self.assertEqual(heard_bytes(self.read_json("apart/summary.json")), [0, 0])

        across = self.mapweave("run", "world/run.yaml", *flags, "--out", "edges", code=(DONE, APART))
        self.assertNotIn("server.share", across.stdout)
        self.assertIn("edge edge0: sent the cloud", across.stdout)
        edge = self.mapweave("run", "world/run.yaml", *flags, "--set", "robots.1.edge=edge0", "--out", "edge", code=(DONE, APART))
        self.assertNotIn("server.share", edge.stdout)
        self.assertNotIn("sent the cloud", edge.stdout)
        summary, of_one = self.read_json("edges/summary.json"), self.read_json("edge/summary.json")
        self.assertNotIn("sharing", of_one)
        there, here = summary["sharing"]
        self.assertEqual((there["edge"], here["edge"]), ("edge0", "edge1"))
        self.assertEqual((there["sent_bytes"], here["sent_bytes"]), (here["received_bytes"], there["received_bytes"]))
        self.assertGreater(min(there["sent_bytes"], here["sent_bytes"]), 10000)
        # About as with one edge: what others saw comes a moment later.
        self.assertGreater(sum(heard_bytes(summary)), 0.5 * sum(heard_bytes(of_one)))
        self.assertGreater(sum(heard_bytes(summary)), 1000)


def heard_bytes(summary):
    return [camera["heard_bytes"] for robot in summary["robots"] for camera in robot["cameras"]]


if __name__ == "__main__":
    support.main()
