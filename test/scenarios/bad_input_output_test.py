"""Results that cannot be written: unwritable places and a full disk. Exit code 1, the reason, nothing half-written."""
import os
import pathlib
import subprocess
import unittest

import support
from option_effect_inputs import WORLDS
from support import APART, CANNOT_WRITE, DONE


class Unwritable(support.Scenario):
    def setUp(self):
        super().setUp()
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")
        self.config = self.configuration([("alpha", "room.log")])

    def refuse(self, out, *words):
        for verb in (("slam", "room.log"), ("run", self.config), ("split", "room.log", "--robots", "2")):
            with self.subTest(f"{verb[0]} to {out}"):
                self.assert_says(self.mapweave(*verb, "--out", out, code=CANNOT_WRITE), out, *words)

    def test_a_file_stands_where_a_folder_is_needed(self):
        self.write("file", "keep me")
        self.refuse("file/out")
        self.refuse("file")
        self.assertEqual((self.folder / "file").read_text(), "keep me")

    def test_a_place_where_nobody_can_write(self):
        self.refuse("/proc/mapweave-out")

    @unittest.skipIf(os.geteuid() == 0, "root may write everywhere")
    def test_a_folder_of_somebody_else_s(self):
        (self.folder / "closed").mkdir(mode=0o500)
        self.refuse("closed/out")

    def test_a_closed_standard_output_is_an_error_too(self):
        with open("/dev/full", "w") as full:
            done = subprocess.run([support.PROGRAM, "inspect", "room.log"], cwd=self.folder, env=support.environment(), stdout=full,
                                  stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(done.returncode, CANNOT_WRITE, done.stderr)


# In a mount namespace of its own, so that this machine's mounts stay as they are.
ON_A_SMALL_DISK = """
set -u
mkdir -p small && mount -t tmpfs -o size=$1 tmpfs small || exit 77
shift
"$@"
code=$?
find small -mindepth 1 > left.txt
exit $code
"""


class FullDisk(support.Scenario):
    def on_a_small_disk(self, size, *arguments, temporary=None):
        unshare = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--user", "--map-root-user"]
        done = subprocess.run([*unshare, "sh", "-c", ON_A_SMALL_DISK, "sh", size, support.PROGRAM, *map(str, arguments)], cwd=self.folder,
                              env={**support.environment(), **({"TMPDIR": str(temporary)} if temporary else {})}, capture_output=True,
                              text=True, timeout=120 * support.PATIENCE, check=False)
        left = pathlib.Path(self.folder / "left.txt")
        if not left.exists():   # the script never came to its end
            raise unittest.SkipTest("mounting a small tmpfs is not permitted here: " + done.stderr.strip())
        names = left.read_text().split()
        left.unlink()
        return done, names

    def test_a_disk_that_fills_up_is_named_and_nothing_half_written_stays(self):
        log = self.write("room.log", "\n".join(support.room_lines(30)) + "\n")
        config = self.configuration([("alpha", log), ("beta", log)])
        for size in ("4k", "32k", "128k"):   # tmpfs counts pages of 4 kB
            for verb in (("slam", log, "--out", "small/out"), ("run", config, "--out", "small/out"), ("split", log, "--robots", "2", "--out", "small/out"),
                         ("convert", log, "small/out.rawlog")):
                with self.subTest(f"{verb[0]} on {size}"):
                    done, left = self.on_a_small_disk(size, *verb)
                    if done.returncode in (DONE, APART):
                        self.assertNotEqual(left, [])   # it had room enough
                        continue
                    self.assertEqual(done.returncode, CANNOT_WRITE, done.stderr)
                    self.assert_says(done, "small/out")
                    self.assertNotIn(".partial-", done.stderr)
                    self.assertRegex(done.stderr.lower(), "space|full")
                    self.assertEqual(left, [])

    def test_a_map_server_s_disk_that_is_full_loses_no_keyframe_and_is_reported(self):
        self.write("world.yaml", WORLDS["cameras"].replace("length_m: 6", "length_m: 8").replace("edges: 2", "edges: 1"))
        self.mapweave("simulate", "world.yaml", "--out", "world")
        options = ("sensor=rgbd", "server.share=view", "server.keyframes=20", "visual.memory.keyframes=20", "output.report=false")
        run = ("run", "world/run.yaml", *(word for option in options for word in ("--set", option)))
        self.assertNotIn("disk", self.mapweave(*run, "--out", "roomy").stdout)
        done, _ = self.on_a_small_disk("4k", *run, "--out", "full", temporary=self.folder / "small")
        self.assertEqual(done.returncode, DONE, done.stderr)
        for text in (done.stdout, done.stderr):
            self.assertRegex(text, r"camera map server of edge0: what its cameras forgot stays in memory, beyond server.keyframes=20: .*/small: .*"
                                   r"No space left on device \(0 bytes free\); free some space, or name another folder in TMPDIR")
        for out in ("roomy", "full"):
            camera = self.read_json(f"{out}/summary.json")["robots"][0]["cameras"][0]
            self.assertGreater(camera["forgotten_keyframes"], 10)
            self.assertEqual(camera["kept_keyframes"], camera["forgotten_keyframes"])


if __name__ == "__main__":
    support.main()
