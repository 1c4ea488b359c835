"""Ctrl-C and SIGTERM in the middle, and a helper process that is killed."""
import os
import pathlib
import signal
import time

import support
from support import CANNOT_WRITE, DONE, INTERRUPTED


def children(pid):
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                name, rest = (entry / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
            except OSError:
                continue
            if int(rest.split()[1]) == pid:
                found.append((int(entry.name), name))
    return sorted(found)


class Interruption(support.Scenario):
    def interrupt(self, process, delay, sign=signal.SIGINT):
        """Sends the signal after `delay` seconds; the exit code, and what was said."""
        time.sleep(delay)
        helpers = [pid for pid, name in children(process.pid) if name == "mrpt_mapper"]
        process.send_signal(sign)
        began = time.monotonic()
        said = "".join(process.communicate(timeout=60 * support.PATIENCE))
        self.assertLess(time.monotonic() - began, 20 * support.PATIENCE, "an interruption is heeded soon")
        for pid in helpers:
            self.assertFalse(pathlib.Path(f"/proc/{pid}").exists() and self.is_running(pid), "a helper outlived the program")
        return process.returncode, said

    def is_running(self, pid):
        for _ in range(50):
            try:
                if pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
                    return False
            except OSError:
                return False
            time.sleep(0.1)
        return True

    def assert_whole_or_absent(self, name):
        """A result that exists is complete: its manifest's files are there and unchanged."""
        self.assert_nothing_left()
        if (self.folder / name).exists():
            inspected = support.json.loads(self.mapweave("inspect", name, "--json").stdout)
            self.assertEqual(inspected["files"]["changed"] + inspected["files"]["missing"], [])

    def test_slam_stops_with_130_and_leaves_nothing_half_written(self):
        log, codes = support.need(support.SIMULATED_BUILDING), []
        for i, (delay, engine, sign) in enumerate([(0.3, "graph", signal.SIGINT), (1.0, "rbpf", signal.SIGINT), (0.6, "rbpf", signal.SIGTERM)]):
            with self.subTest(f"{engine} after {delay} s"):
                process = self.start("slam", log, "--out", f"out{i}", "--engine", engine)
                process.stderr.readline()   # the program has begun
                code, said = self.interrupt(process, delay * support.PATIENCE, sign)
                self.assertIn(code, (INTERRUPTED, DONE), said)
                if code == INTERRUPTED:
                    self.assertIn("interrupt", said.lower())
                self.assert_whole_or_absent(f"out{i}")
                if (self.folder / f"out{i}").exists():
                    self.assertEqual("interrupted" in self.read_json(f"out{i}/manifest.json"), code == INTERRUPTED)
                codes.append(code)
        self.assertIn(INTERRUPTED, codes)

    def test_run_saves_the_robots_that_were_finished(self):
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")
        config = self.configuration([("a_quick", "room.log"), ("b_slow", support.need(support.SIMULATED_BUILDING))], laser="{engine: rbpf}")
        process = self.start("run", config, "--out", "out", "--threads", "1")
        # One robot after the other: when the second begins, the first is finished.
        for line in process.stderr:
            if "robot b_slow" in line:
                break
        code, said = self.interrupt(process, 0.5 * support.PATIENCE)
        self.assertEqual(code, INTERRUPTED, said)
        self.assert_whole_or_absent("out")
        self.assertTrue((self.folder / "out/robots/a_quick/map.pgm").exists())

    def test_ctrl_c_threw_away_all_that_slam_had_or_a_whole_old_result(self):
        log = support.need(support.SIMULATED_BUILDING)
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")
        self.mapweave("slam", "room.log", "--out", "out")
        old = (self.folder / "out/manifest.json").read_text()
        for delay in (0.4, 0.8, 1.6, 3.2):   # until the log is read, but not to its end
            process = self.start("slam", log, "--out", "out", "--force")
            process.stderr.readline()
            code, said = self.interrupt(process, delay * support.PATIENCE)
            if code == DONE:
                self.skipTest("this machine maps the log faster than it is interrupted")
            self.assertEqual(code, INTERRUPTED, said)
            self.assertEqual((self.folder / "out/manifest.json").read_text(), old)
            if (self.folder / "out.interrupted").exists():
                break
        self.assert_whole_or_absent("out.interrupted")
        self.assertTrue(self.read_json("out.interrupted/manifest.json")["interrupted"])
        summary = self.read_json("out.interrupted/summary.json")
        self.assertGreater(summary["robots"][0]["scans"], 0)
        self.assertTrue(any("cut short" in note for note in summary["notes"]), summary["notes"])

    def test_a_terminal_that_goes_away_leaves_nothing_half_written(self):
        if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
            self.skipTest("SIGHUP is ignored here, as under nohup")
        log = support.need(support.SIMULATED_BUILDING)
        process = self.start("slam", log, "--out", "out", "--engine", "rbpf")
        process.stderr.readline()
        code, said = self.interrupt(process, 0.5 * support.PATIENCE, signal.SIGHUP)
        self.assertEqual(code, INTERRUPTED, said)
        self.assert_nothing_left("out")

    def test_a_reader_that_leaves_does_not_end_the_program(self):
        log = support.need(support.MALAGA)
        process = self.start("slam", log, "--out", "out")
        process.stderr.close()   # as `mapweave ... 2>&1 | head` does
        process.stderr = None
        process.communicate(timeout=60 * support.PATIENCE)
        self.assertEqual(process.returncode, DONE)
        self.assert_whole_or_absent("out")
        self.assertTrue((self.folder / "out/map.png").exists())

    def test_a_killed_helper_ends_its_own_robot_only(self):
        slow = support.need(support.SIMULATED_BUILDING)
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")
        config = self.configuration([("alpha", "room.log"), ("beta", slow)], laser="{engine: rbpf}")
        process = self.start("run", config, "--out", "out", "--threads", "1")
        # alpha's helper comes first and is quick: the second one is beta's, and so is one that nobody came before for long
        killed, since = None, {}
        deadline = time.monotonic() + 60 * support.PATIENCE
        while killed is None and process.poll() is None and time.monotonic() < deadline:
            for pid, name in children(process.pid):
                if name != "mrpt_mapper":
                    continue
                there_s = time.monotonic() - since.setdefault(pid, time.monotonic())
                if there_s > 6 * support.PATIENCE or (len(since) > 1 and pid == list(since)[-1] and there_s > 0.3):
                    os.kill(pid, signal.SIGKILL)
                    killed = pid
            time.sleep(0.05)
        self.assertIsNotNone(killed, "no helper was running")
        said, message = process.communicate(timeout=180 * support.PATIENCE)
        self.assertEqual(process.returncode, CANNOT_WRITE, message)
        self.assertIn("mrpt_mapper", said + message)
        self.assertIn("beta", said + message)
        self.assertTrue((self.folder / "out/robots/alpha/map.pgm").exists())
        self.assertIn("trouble", {robot["id"]: robot for robot in self.read_json("out/summary.json")["robots"]}["beta"])

    def test_where_the_only_helper_is_killed_there_is_no_result(self):
        log = support.need(support.SIMULATED_BUILDING)
        config = self.configuration([("alpha", log)], laser="{engine: rbpf}")
        for command in (("slam", log, "--engine", "rbpf"), ("run", config)):
            with self.subTest(command[0]):
                process = self.start(*command, "--out", "out")
                deadline = time.monotonic() + 60 * support.PATIENCE
                while process.poll() is None and time.monotonic() < deadline:
                    helpers = [pid for pid, name in children(process.pid) if name == "mrpt_mapper"]
                    if helpers:
                        os.kill(helpers[0], signal.SIGKILL)
                        break
                    time.sleep(0.02)
                _, message = process.communicate(timeout=60 * support.PATIENCE)
                self.assertEqual(process.returncode, CANNOT_WRITE, message)
                self.assertIn("helper mrpt_mapper ended by signal", message)
                self.assert_nothing_left("out")


if __name__ == "__main__":
    support.main()
