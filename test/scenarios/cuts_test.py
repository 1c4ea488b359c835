"""Parts of public logs, each mapped alone: none may be worse than the log, whatever its first minutes look like."""
import json
import os
import pathlib
import unittest

import support

DATA = pathlib.Path(os.environ.get("MAPWEAVE_DATA", support.ROOT.parent / "shared/data"))
MOST_M = 0.018  # mean error of relations; the whole log 0.0136, its parts 0.0107 to 0.0150


class Cuts(support.Scenario):
    def test_every_sixth_of_intel_is_as_straight_as_the_log(self):
        log, relations = DATA / "laser/intel/intel.rawlog", DATA / "laser/intel/intel.relations"
        if not log.exists():
            self.skipTest(f"needs {log} (MAPWEAVE_DATA)")
        self.mapweave("split", log, "--robots", "6", "--out", "parts")
        # A stretch whose first turns seemed to be those of scans that are stamped 114 ms late.
        self.mapweave("split", log, "--robots", "3", "--at", "976053421.5249", "--at", "976054244.8405", "--out", "late")
        for part in (*(f"parts/robot{i}" for i in range(6)), "late/robot1"):
            with self.subTest(part=part):
                self.mapweave("slam", f"{part}.rawlog", "--out", "map", "--force", "--set", "output.report=false")
                error = json.loads(self.mapweave("evaluate", "relations", "map/trajectory.tum", relations, "--json").stdout)
                self.assertLess(error["translation_mean_m"], MOST_M)


if __name__ == "__main__":
    support.main()
