"""Damaged maps, names of strange bytes, links that lead nowhere, pipes, two runs at one place: an answer that blames the right thing."""
import os
import shutil
import subprocess
import threading
import time

import support
from support import BAD_INPUT, CANNOT_WRITE, USAGE


class Surroundings(support.Scenario):
    def setUp(self):
        super().setUp()
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")

    def test_inspect_listed_a_damaged_map_that_export_refused(self):
        self.mapweave("slam", "room.log", "--out", "out")
        data = bytearray((self.folder / "out/map.mwdb").read_bytes())
        found = 0
        for place in range(4096, len(data) - 64, 1511):
            damaged = bytearray(data)
            for i in range(64):
                damaged[place + i] ^= 0x5A
            (self.folder / "bad.mwdb").write_bytes(damaged)
            exported = self.mapweave("export", "bad.mwdb", "--out", "pictures", "--png", "--force", code=(0, BAD_INPUT))
            seen = self.mapweave("inspect", "bad.mwdb", code=exported.returncode)
            found += exported.returncode != 0
            if exported.returncode != 0:
                self.assert_says(seen, "bad.mwdb")
        self.assertGreater(found, 3)

    def test_a_log_whose_path_is_no_utf_8_is_mapped_to_the_end(self):
        folder = os.path.join(os.fsencode(self.folder), b"caf\xe9")
        os.mkdir(folder)
        log = os.path.join(folder, b"ro\xe9m.log")
        shutil.copy(os.fsencode(self.folder / "room.log"), log)
        for verb, out in (("slam", "out"), ("split", "parts")):
            command = [os.fsencode(support.PROGRAM), verb.encode(), log, b"--out", out.encode()] + ([b"--robots", b"2"] if verb == "split" else [])
            done = subprocess.run(command, cwd=self.folder, env=support.environment(), capture_output=True, timeout=120, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.folder / "out/map.mwdb").exists())
        self.assertIn("\ufffd", self.read_json("out/manifest.json")["inputs"][0]["path"])
        self.mapweave("inspect", "out")

    def test_an_empty_name_was_an_internal_error(self):
        for arguments in (("slam", "", "--out", "out"), ("inspect", ""), ("slam", "room.log", "--out", ""), ("slam", "room.log", "--out=")):
            self.assert_says(self.mapweave(*arguments, code=USAGE), "empty name")
        self.mapweave("slam", "room.log", "--out", "out", "--robot", "")

    def test_links_in_a_circle_were_internal_errors(self):
        os.symlink("b", self.folder / "a")
        os.symlink("a", self.folder / "b")
        for arguments in (("inspect", "a"), ("merge", "a", "--out", "out"), ("slam", "a", "--out", "out"), ("export", "a", "--out", "out", "--png")):
            self.assert_says(self.mapweave(*arguments, code=BAD_INPUT), "symbolic links")
        done = self.mapweave("slam", "room.log", "--out", "a", code=CANNOT_WRITE)
        self.assert_says(done, "a:", "symbolic links")
        self.assertNotIn("holds the input", done.stderr)

    def test_a_link_that_leads_nowhere_was_reported_after_the_mapping(self):
        os.symlink("nowhere", self.folder / "out")
        done = self.mapweave("slam", "room.log", "--out", "out", code=CANNOT_WRITE)
        self.assert_says(done, "out", "link to nowhere")
        self.assertNotIn("scans read", done.stderr)

    def test_two_runs_at_one_place_spoke_of_permissions(self):
        lines = []
        for i in range(4000):
            x = 2.0 + 0.05 * min(i % 80, 79 - i % 80)   # to and fro
            lines.append(support.carmen_scan(1000.0 + 0.2 * i, support.room_ranges(x, 2.0, 0.0), x, 2.0, 0.0))
        self.write("long.log", "\n".join(lines) + "\n")
        first = self.start("slam", "long.log", "--out", "out")
        for _ in range(500):
            if list(self.folder.glob("out.partial-*")):
                break
            time.sleep(0.01)
        self.assert_says(self.mapweave("slam", "room.log", "--out", "out", code=CANNOT_WRITE), "out", f"another run (process {first.pid})")
        first.kill()
        first.communicate()
        self.mapweave("slam", "room.log", "--out", "out")   # what it left is no run

    def test_pipes_that_nobody_writes_to_are_not_waited_for(self):
        for name in ("pipe", "pipe.yaml", "pipe.mwj"):
            os.mkfifo(self.folder / name)
            for arguments in (("inspect", name), ("config", "check", name), ("run", name, "--out", "out"), ("convert", name, "out.rawlog"),
                              ("merge", name, "--out", "out"), ("slam", name, "--out", "out"), ("plan", name)):
                done = self.mapweave(*arguments, code=(BAD_INPUT, USAGE), seconds=20)
                self.assert_says(done, name)
                self.assertNotIn("there is no log", done.stderr)

    def test_a_configuration_may_come_through_a_pipe(self):
        os.mkfifo(self.folder / "team.yaml")
        writer = threading.Thread(target=lambda: (self.folder / "team.yaml").write_text("robots: [{id: alpha, log: room.log}]\n"))
        writer.start()
        self.assertIn("is fine", self.mapweave("config", "check", "team.yaml", seconds=20).stdout)
        writer.join()

    def test_a_log_of_standard_input_is_a_pipe_and_not_absent(self):
        done = subprocess.run([support.PROGRAM, "slam", "/dev/stdin", "--out", "out"], cwd=self.folder, env=support.environment(), text=True,
                              input="FLASER\n", capture_output=True, timeout=60, check=False)
        self.assertEqual(done.returncode, BAD_INPUT, done.stderr)
        self.assert_says(done, "/dev/stdin", "pipe")

    def test_damaged_lines_of_a_text_log_are_counted(self):
        lines = support.room_lines(30)
        lines[10] = lines[10].replace("FLASER", "FLA\0ER")
        data = ("\n".join(lines) + "\n").encode() + bytes((i * 7919 + i * i * 31) % 256 for i in range(4096))
        (self.folder / "bad.log").write_bytes(data)
        self.assert_says(self.mapweave("slam", "bad.log", "--out", "out"), "bad.log:11", "lines that are damaged")

    def test_a_doubled_robot_of_a_world_names_the_file(self):
        self.write("world.yaml", "robots:\n  - {id: alpha}\n  - {id: alpha}\n")
        self.assert_says(self.mapweave("simulate", "world.yaml", "--out", "out", code=BAD_INPUT), "world.yaml", "robot 'alpha'", "two robots have this id")

    def test_a_bandwidth_of_next_to_nothing_does_not_blame_capacities(self):
        self.write("problem.json", """{"robots": ["a", "b"], "robot_scans": {"a": 10, "b": 10}, "overlaps": [["a", "b", 0.1]],
            "edges": [{"id": "e0", "bandwidth_bytes_per_s": 1e-320}, {"id": "e1", "bandwidth_bytes_per_s": 1e6}]}""")
        done = self.mapweave("plan", "problem.json", code=BAD_INPUT)
        self.assert_says(done, "problem.json", "bandwidth_bytes_per_s")
        config = self.write("team.yaml", "robots: [{id: alpha, log: room.log}]\nnetwork: {robot_edge: {bytes_per_s: 1e-320}}\n")
        done = self.mapweave("config", "check", config, code=BAD_INPUT)
        self.assert_says(done, "team.yaml:2", "never delivers")

    def test_a_chequered_picture_took_minutes(self):
        side = 8000
        rows = [bytes(254 if (i + j) % 2 else 0 for i in range(side)) for j in range(2)]
        (self.folder / "board.pgm").write_bytes(b"P5\n%d %d\n255\n" % (side, side) + b"".join(rows[j % 2] for j in range(side)))
        self.write("board.yaml", "image: board.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
        done = self.mapweave("merge", "board.yaml", "--out", "out", code=BAD_INPUT, seconds=40)
        self.assert_says(done, "board.yaml", "cells of wall")


if __name__ == "__main__":
    support.main()
