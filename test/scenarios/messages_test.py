"""Small messages that were wrong, each named after what the user saw."""
import pathlib
import shutil
import subprocess
import tempfile

import support
from support import APART, BAD_INPUT


def other_room_lines(scans):
    """A long narrow corridor, which shares nothing with the room of support.room_lines()."""
    lines = []
    for i in range(scans):
        x = 1.0 + 0.05 * i
        ranges = []
        for ray in range(181):
            angle = support.math.pi * (ray / 180 - 0.5)
            c, s = support.math.cos(angle), support.math.sin(angle)
            ahead = (14.0 - x) / c if c > 1e-9 else 1e9
            ranges.append(min(ahead, 0.9 / abs(s) if abs(s) > 1e-9 else 1e9))
        lines.append(support.carmen_scan(5000.0 + 0.2 * i, ranges, x, 0.0, 0.0))
    return lines


class MapsThatStayedApart(support.Scenario):
    def setUp(self):
        super().setUp()
        self.write("room.log", "\n".join(support.room_lines(40)) + "\n")
        self.write("hall.log", "\n".join(other_room_lines(40)) + "\n")

    def test_lie_in_team_1_and_team_2_and_there_is_no_team(self):
        done = self.mapweave("run", self.configuration([("alpha", "room.log"), ("beta", "hall.log")]), "--out", "out", code=APART)
        self.assertEqual(sorted(path.name for path in (self.folder / "out").glob("team*")), ["team-1", "team-2"])
        self.assertIn("picture: out/team-1/map.color.png", done.stdout)
        robots = [robot for members in self.read_json("out/summary.json")["team"]["members"] for robot in members]
        for number, robot in enumerate(robots, 1):
            self.assertTrue((self.folder / f"out/team-{number}/trajectories/{robot}.tum").exists(), robot)
        self.mapweave("merge", "out", "--out", "again", code=APART)
        self.mapweave("merge", "out", "--without", "beta", "--out", "alone")
        self.assertTrue((self.folder / "alone/team").exists(), "one map")
        self.assertIn("alpha", self.mapweave("explain", "out", "alpha", "beta").stdout)
        page = (self.folder / "out/report.html").read_text()
        for number in (1, 2):
            self.assertIn(f'"team-{number}"', page)


class Cameras(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        rooms = "robots=[{id: alpha, length_m: 6, first_room: 0, last_room: 1}, {id: beta, length_m: 6, first_room: 0, last_room: 1}]"
        subprocess.run([support.PROGRAM, "simulate", support.ROOT / "configs/worlds/camera_team.yaml", "--set", rooms, "--set", "logs.layout=both",
                        "--out", cls.world], env=support.environment(), capture_output=True, check=True)

    def test_their_maps_are_drawn_and_the_picture_is_named(self):
        done = self.mapweave("run", self.world / "run.yaml", "--set", "sensor=rgbd", "--out", "seen", code=(support.DONE, APART))
        team = "team" if (self.folder / "seen/team").exists() else "team-1"
        self.assertIn(f"picture: seen/{team}/map.png", done.stdout)
        self.assertTrue((self.folder / f"seen/{team}/map.png").exists())
        merged = self.mapweave("merge", "seen/robots/alpha/map.mwdb", "seen/robots/beta/map.mwdb", "--out", "merged", code=(support.DONE, APART))
        for text in (done.stdout, merged.stdout):
            self.assertNotIn("not drawn", text)
        self.assertIn("picture: merged/team", merged.stdout)
        self.assertTrue((self.folder / "merged/robots/alpha/map.png").exists())

    def test_a_folder_of_pictures_is_not_read_to_its_end_to_find_no_laser(self):
        done = self.mapweave("slam", self.world / "alpha_camera", "--sensor", "laser", "--out", "o", code=BAD_INPUT)
        self.assert_says(done, "the log has no laser; it has depth camera", "leave the choice to auto")
        self.assertNotIn("begins", done.stderr, "nothing was mapped before it was said")


if __name__ == "__main__":
    support.main()
