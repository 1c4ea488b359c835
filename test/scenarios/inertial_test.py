"""What inertial units are worth beside a laser: they are believed where they agree with the scans, else a note says why not."""
import json
import unittest

import support

WORLD = """
seed: 7
buildings: [{{kind: apartment, furniture: {{round: 0.3}}, apartment: {{width_m: 8, height_m: 7}}}}]
laser: {{rays: 121, scans_per_second: 5, max_range_m: 8}}
motion: {{turn_rate_deg_per_s: 120}}
odometry: {{yaw_noise_deg: 2, slips_per_100_m: 40, slip_min_deg: 5, slip_max_deg: 15}}
imu: {{readings_per_second: 50, gyro_scale: {scale}}}
robots: [{{id: alpha, length_m: 20}}]
"""


class InertialUnits(support.Scenario):
    def simulated(self, scale):
        self.write("world.yaml", WORLD.format(scale=scale))
        self.mapweave("simulate", "world.yaml", "--force", "--out", "world")
        return self.folder / "world/alpha.rawlog"

    def error(self, trajectory):
        done = self.mapweave("evaluate", "trajectory", self.folder / trajectory, self.folder / "world/alpha.truth.tum", "--align", "se2", "--json")
        return json.loads(done.stdout)["ate_translation_rmse_m"]

    def test_what_is_wrong_with_an_inertial_unit_is_found_out(self):
        for scale, expected in ((1, None), (0, "dead"), (-1, "upside down"), (57.29578, "degrees")):
            log = self.simulated(scale)
            out = f"scale{scale}"
            done = self.mapweave("slam", log, "--out", out)
            notes = " ".join(self.read_json(f"{out}/summary.json")["notes"])
            if expected is None:
                self.assertNotIn("inertial unit", notes)
            else:
                self.assertIn("inertial unit", notes)
                self.assertIn(expected, notes)
                self.assertIn(expected, done.stdout + done.stderr)
            self.assertLess(self.error(f"{out}/trajectory.tum"), 0.06)
            if scale == 1:
                self.mapweave("slam", log, "--set", "laser.scan.inertial=none", "--out", "without")
                self.assertNotEqual((self.folder / "without/trajectory.tum").read_bytes(), (self.folder / out / "trajectory.tum").read_bytes())
                self.mapweave("slam", log, "--engine", "icp", "--out", "icp")
                self.assertIn("ignore it", " ".join(self.read_json("icp/summary.json")["notes"]))


if __name__ == "__main__":
    unittest.main()
