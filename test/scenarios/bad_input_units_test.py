"""Logs in millimetres, centimetres and degrees, and a wrong depth_scale: told with the guess; an error where nothing can be mapped."""
import math
import shutil

import support
from support import BAD_INPUT
from bad_input_camera_test import png


class Units(support.Scenario):
    def room(self, name, laser=1.0, odometry=1.0, angle=1.0):
        lines = []
        for i in range(60):
            x, y, heading = 2.0 + 0.05 * i, 2.0 + 0.02 * i, 0.3 * math.sin(0.2 * i)
            ranges = [laser * value for value in support.room_ranges(x, y, heading)]
            lines.append(support.carmen_scan(1000.0 + 0.2 * i, ranges, odometry * x, odometry * y, angle * heading))
        return self.write(name, "\n".join(lines) + "\n").name

    def test_a_log_in_millimetres_ended_with_nothing_was_seen_and_exit_0(self):
        name = self.room("mm.log", laser=1000.0, odometry=1000.0)
        self.assert_says(self.mapweave("slam", name, "--out", "out", code=BAD_INPUT), "mm.log", "nothing can be mapped", "millimetres")
        config = self.configuration([("alpha", name)])
        self.assert_says(self.mapweave("run", config, "--out", "out", code=BAD_INPUT), "mm.log", "millimetres")
        self.assert_nothing_left("out")
        self.assertIn("millimetres", self.mapweave("inspect", name).stdout)

    def test_a_log_in_centimetres_is_reported(self):
        done = self.mapweave("slam", self.room("cm.log", laser=100.0, odometry=100.0), "--out", "out", code=(0, BAD_INPUT))
        self.assert_says(done, "centimetres")

    def test_odometry_in_millimetres_is_reported_and_the_laser_maps(self):
        done = self.mapweave("slam", self.room("wheels.log", odometry=1000.0), "--out", "out")
        self.assert_says(done, "warning", "odometry moves", "millimetres")
        self.assertTrue(any("millimetres" in note for note in self.read_json("out/summary.json")["notes"]))

    def test_headings_in_degrees_are_reported(self):
        done = self.mapweave("slam", self.room("degrees.log", angle=180.0 / math.pi), "--out", "out")
        self.assert_says(done, "warning", "degrees")

    def test_metres_and_radians_are_not_doubted(self):
        name = self.room("good.log")
        done = self.mapweave("slam", name, "--out", "out")
        self.assertNotIn("warning", done.stderr)
        self.assertNotIn("doubts", self.mapweave("inspect", name).stdout)

    def test_a_depth_scale_of_1000_for_5000_made_a_map_five_times_too_large(self):
        for i in range(12):
            stamp = f"{50 + 0.1 * i:.6f}"
            for kind, bits, value in (("rgb", 8, 20 + i), ("depth", 16, 14000 + i)):
                path = self.write(f"walk/{kind}/{stamp}.png", "")
                path.write_bytes(png(80, 64, bits, value))
        for kind in ("rgb", "depth"):
            self.write(f"walk/{kind}.txt", "".join(f"{50 + 0.1 * i:.6f} {kind}/{50 + 0.1 * i:.6f}.png\n" for i in range(12)))
        calibration = "width: 80\nheight: 64\nfx: 80\nfy: 80\ncx: 40\ncy: 32\ndistortion: [0, 0, 0, 0, 0]\ndepth_scale: {}\n"
        self.write("walk/camera.yaml", calibration.format(1000))
        self.assertIn("is it 5000 (TUM RGB-D)?", self.mapweave("inspect", "walk").stdout)
        self.assert_says(self.mapweave("slam", "walk", "--out", "out", code=BAD_INPUT), "warning", "is it 5000 (TUM RGB-D)?")
        self.write("walk/camera.yaml", calibration.format(5000))
        self.assertNotIn("doubts", self.mapweave("inspect", "walk").stdout)
        shutil.rmtree(self.folder / "walk")


if __name__ == "__main__":
    support.main()
