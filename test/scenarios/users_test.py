"""Sessions of users with logs: the steps that one takes after the other, and that nothing is silently dropped between them."""
import gzip
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
import unittest

import support
from messages_test import other_room_lines
from strict_readers import Grid, read_tum
from support import APART, BAD_INPUT, DONE, INTERRUPTED, USAGE
from users import Session, evos_errors, relative_errors

DATA = pathlib.Path(os.environ.get("MAPWEAVE_DATA", support.ROOT.parent / "shared/data"))


class Student(Session):
    """Has a folder of TUM RGB-D and a CARMEN log, and believes evo."""

    def test_a_folder_as_downloaded_has_the_errors_that_evo_says(self):
        log = DATA / "visual/tum_fr1_rpy"
        if not log.exists():
            raise unittest.SkipTest(f"needs {log}")
        (self.folder / "rgbd_dataset_freiburg1_rpy").mkdir()
        for name in ("rgb", "depth", "rgb.txt", "depth.txt", "groundtruth.txt"):
            (self.folder / "rgbd_dataset_freiburg1_rpy" / name).symlink_to(log / name)
        self.assertIn("freiburg1", self.mapweave("inspect", "rgbd_dataset_freiburg1_rpy").stdout + self.mapweave("inspect", "rgbd_dataset_freiburg1_rpy").stderr)
        camera, = self.json_of("slam", "rgbd_dataset_freiburg1_rpy", "--out", "rpy")["robots"][0]["cameras"]
        written, reference = self.folder / "rpy/trajectory.tum", log / "groundtruth.txt"
        estimate = read_tum(written)
        self.assertEqual(camera["frames"], camera["tracked"] + camera["lost"])
        self.assertEqual(len(estimate), camera["tracked"], "a pose for each frame that was tracked")
        rows = [[float(word) for word in line.split()] for line in reference.read_text().splitlines() if line[0] != "#"]
        begin, end = estimate[0][0] - 1, estimate[-1][0] + 1
        metres, degrees = relative_errors(estimate, [row for row in rows if begin < row[0] < end])
        self.assertAlmostEqual(metres, 0.00799, delta=0.0002)
        self.assertAlmostEqual(degrees, 0.556, delta=0.01)
        ours = self.json_of("evaluate", "trajectory", "rpy", "rgbd_dataset_freiburg1_rpy")
        errors = [(ours["rpe_translation_rmse_m"], ours["rpe_rotation_rmse_deg"])]
        if shutil.which("evo_rpe"):
            errors.append(evos_errors(reference, written))
        for said in errors:
            self.assertAlmostEqual(said[0], metres, delta=2e-6)
            self.assertAlmostEqual(said[1], degrees, delta=2e-5)

    def test_a_carmen_log_keeps_every_scan_from_the_first_look_to_the_numbers(self):
        lines = support.room_lines(60)
        whole = self.write_log("room.log", lines)
        damaged = self.write_log("damaged.log", [*lines[:20], lines[20].replace("FLASER", "FLA\0ER"), *lines[21:], "?" * 4096])
        mangled = self.write_log("mangled.log", [*lines[:20], lines[20].replace("FLASER 181 ", "FLASER 181 \0"), *lines[21:]])
        (self.folder / "room.clf.gz").write_bytes(gzip.compress((self.folder / whole).read_bytes()))
        self.write("odometry.txt", "".join(f"{1000.0 + 0.2 * i:.6f} {2.0 + 0.05 * i:.6f} {2.0 + 0.02 * i:.6f} {0.01 * i:.6f}\n" for i in range(60)))
        self.mapweave("convert", "room.clf.gz", "room.rawlog")
        for log in (whole, "room.clf.gz", "room.rawlog"):
            self.assertEqual(self.json_of("inspect", log)["scans"], 60, log)
            out = log.replace(".", "_")
            self.mapweave("slam", log, "--robot", "me", "--out", out)
            self.assertEqual([row[0] for row in read_tum(self.folder / out / "trajectory.tum")], [round(1000.0 + 0.2 * i, 6) for i in range(60)])
            self.assertEqual((self.folder / out / "map.pgm").read_bytes(), (self.folder / "room_log/map.pgm").read_bytes(), log)
            numbers = self.json_of("evaluate", "trajectory", out, "odometry.txt")
            self.assertEqual((numbers["pairs"], numbers["covered"]), (60, 1.0))
            self.assertLess(numbers["ate_translation_rmse_m"], 0.02)
            self.assert_whole(out)
        # What is lost on the way is counted, and what is not lost is there.
        done = self.mapweave("slam", damaged, "--robot", "me", "--out", "rest")
        self.assert_says(done, "damaged.log", "2 lines")
        self.assertEqual(self.poses("rest/trajectory.tum"), 59)
        self.assertEqual(self.json_of("inspect", damaged)["scans"], 59)
        self.assert_says(self.mapweave("slam", mangled, "--out", "no", code=BAD_INPUT), "mangled.log:21", "is no number", "remove the line")


class Integrator(Session):
    """Serves a fleet: goals and zones stand in Monday's map, and must stay where they are whoever drives later."""

    def test_a_week_of_merges_keeps_mondays_goals(self):
        self.mapweave("split", support.need(support.MALAGA), "--robots", "3", "--out", "logs")
        for robot, log in (("zeta", "robot2"), ("alpha", "robot0"), ("beta", "robot1")):
            self.mapweave("slam", f"logs/{log}.rawlog", "--robot", robot, "--out", robot)
        self.write_log("hall.log", other_room_lines(40))
        self.mapweave("slam", "hall.log", "--robot", "stranger", "--out", "stranger")
        monday = self.served("zeta", "map.mwdb")
        goals = read_tum(self.folder / "zeta/trajectory.tum")
        walls = Grid(self.folder / "zeta/map.yaml").walls()
        robots, before = ["zeta"], "zeta"
        for version, (day, robot) in enumerate((("tuesday", "alpha"), ("wednesday", "beta")), 2):
            done = self.mapweave("merge", before, robot, "--out", day)
            self.assertIn("the frame is that of ", done.stdout)
            robots = sorted([*robots, robot])
            self.assertEqual(self.robots_in(day), {"team": robots})
            map_id, number, content = self.served(day, "team/map.mwdb")
            self.assertEqual((map_id, number), (monday[0], str(version)))
            self.assertNotEqual(content, monday[2])
            goals = self.assert_goals_stay(day, goals, walls)
            for one in robots:
                self.assertEqual(self.poses(f"{day}/team/trajectories/{one}.tum"), self.poses(f"{one}/trajectory.tum"), one)
            before = day
        # A robot from somewhere else changes nothing of the map, and is not lost.
        self.mapweave("merge", before, "stranger", "--out", "thursday", code=APART)
        teams = self.robots_in("thursday")
        self.assertEqual(sorted(teams.values(), key=len), [["stranger"], robots])
        ours = next(name for name, members in teams.items() if "zeta" in members)
        self.assertEqual(self.served("thursday", f"{ours}/map.mwdb")[0], monday[0])
        other = next(name for name in teams if name != ours)
        self.assertNotEqual(self.served("thursday", f"{other}/map.mwdb")[0], monday[0])
        self.assertEqual((self.folder / "thursday" / ours / "map.pgm").read_bytes(), (self.folder / "wednesday/team/map.pgm").read_bytes())

    def assert_goals_stay(self, day, goals, walls):
        """The frame to the millimetre; what was merged may correct the rest of the map, by what is said."""
        frame, = self.read_json(f"{day}/summary.json")["team"]["frames"]
        now = read_tum(self.folder / day / "team/trajectories/zeta.tum")
        for one, other in zip(goals[0][1:], now[0][1:]):
            self.assertAlmostEqual(one, other, delta=5e-4)
        moved_m = max(math.dist(one[1:4], other[1:4]) for one, other in zip(goals, now))
        self.assertLess(moved_m, frame["most_moved_m"] + 1e-3, "more than was said")
        grid = Grid(self.folder / day / "team/map.yaml")
        within = 1 + math.ceil(frame["most_moved_m"] / grid.resolution_m)
        self.assertGreater(sum(grid.is_wall(x, y, within) for x, y in walls), 0.8 * len(walls), "walls went elsewhere")
        return now

    def served(self, results, store):
        """Id, version and hash, which are the same wherever they stand."""
        keys = Grid((self.folder / results / store).with_name("map.yaml")).keys
        found = tuple(keys[key] for key in ("map_id", "map_version", "content_hash"))
        listed = self.read_json(f"{results}/manifest.json")["maps"][store]
        self.assertEqual(found, tuple(str(listed[key]) for key in ("map_id", "map_version", "content_hash")))
        metadata = self.json_of("inspect", f"{results}/{store}")["metadata"]
        self.assertEqual(found[:2], (metadata["map_id"], metadata["map_version"]))
        return found


class Operator(Session):
    """Looks after an inbox: whatever happens, every job is somewhere, and is mapped once."""

    BATCH = support.ROOT / "gui-less/systemd/mapweave-batch"
    STATES = ("inbox", "working", "done", "failed")

    def batch(self, *arguments):
        return subprocess.Popen([self.BATCH, *arguments], env={**support.environment(), "PROGRAM": str(support.PROGRAM), "SETTLE_SECONDS": "0"}, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)

    def jobs(self):
        """Every job by where it is; what the batch itself writes about jobs left out."""
        return {state: sorted(path.name for path in (self.home / state).glob("*") if path.suffix not in (".txt", ".yaml", ".attempts"))
                for state in self.STATES}

    def status(self):
        return self.batch("--status", self.home).communicate(timeout=30)[0]

    def assert_no_job_is_lost(self):
        self.assertEqual(sorted(name for names in self.jobs().values() for name in names), sorted(self.given))

    def test_an_inbox_of_which_nothing_is_lost(self):
        slow = support.need(support.SIMULATED_BUILDING)
        self.home = self.folder / "site"
        (self.home / "inbox/team").mkdir(parents=True)
        room, hall = "\n".join(support.room_lines(40)) + "\n", "\n".join(other_room_lines(40)) + "\n"
        self.write("site/inbox/a_room.log", room)
        self.write("site/inbox/bad.rawlog", "this is no log\n")
        self.write("site/inbox/late.log.part", room)
        self.write("site/inbox/team/one.log", room)
        self.write("site/inbox/team/two.log", hall)
        shutil.copy(slow, self.home / "inbox/b_slow.rawlog")
        self.given = ["a_room.log", "b_slow.rawlog", "bad.rawlog", "late.log.part", "team"]
        time.sleep(0.05)
        self.stop_in_the_middle(self.write("slow.yaml", "laser: {engine: rbpf}\n"))
        self.assert_no_job_is_lost()
        self.assertFalse((self.home / "results/b_slow.rawlog").exists())
        self.take_back("b_slow.rawlog")
        said = self.run_batch()
        self.assert_no_job_is_lost()
        self.assertEqual(self.jobs(), {"inbox": ["late.log.part"], "working": [], "done": ["a_room.log", "team"], "failed": ["bad.rawlog"]}, said)
        self.assertIn("bad.rawlog", (self.home / "failed/bad.rawlog.txt").read_text())
        self.assertIn("waiting 0, arriving 1, working 0, done 2, failed 1", self.status())
        (self.home / "inbox/late.log.part").rename(self.home / "inbox/late.log")
        self.given[self.given.index("late.log.part")] = "late.log"
        time.sleep(0.05)
        self.run_batch()
        self.assert_no_job_is_lost()
        for job in ("a_room.log", "late.log", "team"):
            self.assert_whole(f"site/results/{job}")
            self.assertIn(job, (self.home / "index.html").read_text())
        self.assertEqual(sorted(sum(self.robots_in("site/results/team").values(), [])), ["one", "two"])
        self.assertIn('mapweave_batch_jobs{state="done"} 3\n', (self.home / "metrics.prom").read_text())

    def take_back(self, job):
        """Removes a job that would take minutes, from where it waits for the next time."""
        for state in ("inbox", "working"):
            (self.home / state / job).unlink(missing_ok=True)
        self.given.remove(job)

    def run_batch(self):
        process = self.batch(self.home)
        said = process.communicate(timeout=100 * support.PATIENCE)[1]
        self.assertEqual(process.returncode, DONE, said)
        return said

    def stop_in_the_middle(self, configuration):
        process = self.batch(self.home, configuration)
        self.addCleanup(lambda: process.poll() is None and os.killpg(process.pid, signal.SIGKILL))
        deadline = time.monotonic() + 60 * support.PATIENCE
        while time.monotonic() < deadline and not (self.home / "working/b_slow.rawlog").exists():
            time.sleep(0.02)
        time.sleep(0.5)
        self.assertIn("a batch is at work", self.status())
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60 * support.PATIENCE)
        self.assertEqual(process.returncode, INTERRUPTED)

    def test_what_an_interruption_left_is_known_as_a_part_wherever_it_goes(self):
        log = support.need(support.SIMULATED_BUILDING)
        self.write_log("room.log", support.room_lines(40))
        self.mapweave("slam", "room.log", "--out", "room")
        for delay in (0.6, 1.2, 2.4, 4.8):
            process = self.start("slam", log, "--out", "part")
            process.stderr.readline()
            time.sleep(delay * support.PATIENCE)
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60 * support.PATIENCE)
            if process.returncode == DONE:
                self.skipTest("this machine maps the log faster than it is interrupted")
            if (self.folder / "part").exists():
                break
        self.assertEqual(process.returncode, INTERRUPTED)
        robot, = self.read_json("part/summary.json")["robots"]
        self.assertTrue(robot["cut_short"])
        self.assertEqual(self.poses("part/trajectory.tum"), robot["scans"])
        self.assertLess(robot["scans"], self.json_of("inspect", log)["scans"])
        self.assert_whole("part")
        self.assertIn("cut_short", self.json_of("inspect", "part/map.mwdb")["metadata"])
        self.assertIn("interrupted", (self.folder / "part/report.html").read_text())
        merged = self.json_of("merge", "part", "room", "--out", "both", code=(DONE, APART))
        self.assertTrue(any("cut short" in note for note in merged["notes"]), merged["notes"])
        again = self.json_of("merge", "both", "--out", "again", code=(DONE, APART))
        self.assertTrue(any("cut short" in note for note in again["notes"]), again["notes"])


class Newcomer(Session):
    """Knows the README's two commands, types badly, and does what the messages say."""

    def follow(self, *words, most=8):
        """Types a command, and as long as it is refused does what its message proposes; the message of each step."""
        messages, words = [], list(words)
        for _ in range(most):
            done = self.mapweave(*words, code=(DONE, USAGE, BAD_INPUT))
            if done.returncode == DONE:
                return done, messages, words
            messages.append(done.stderr)
            wrong, right = self.proposal(done.stderr)
            self.assertIn(wrong, words, done.stderr)
            words[words.index(wrong)] = right
        self.fail(f"still refused: {messages}")

    def proposal(self, message):
        found = re.search(r"'([^']+)'.*did you mean '([^']+)'", message)
        self.assertTrue(found, message)
        return found.groups()

    def test_typing_what_the_messages_propose_ends_with_a_map(self):
        self.write_log("alpha.log", support.room_lines(40))
        done, messages, words = self.follow("slma", "alpha.log", "--engine", "grahp", "--theads", "1", "--otu", "maps/alpha")
        self.assertEqual(words, ["slam", "alpha.log", "--engine", "graph", "--threads", "1", "--out", "maps/alpha"])
        self.assertEqual(len(messages), 4)
        self.assert_paths_are_there(done.stdout)
        self.assertEqual(self.poses("maps/alpha/trajectory.tum"), 40)

    def assert_paths_are_there(self, said):
        paths = re.findall(r"^(?:results|picture|page): (\S+)$", said, re.MULTILINE)
        self.assertGreaterEqual(len(paths), 2, said)
        for path in paths:
            self.assertTrue((self.folder / path).exists(), path)

    def test_a_configuration_is_mended_key_by_key(self):
        for robot in ("alpha", "beta"):
            self.write_log(f"{robot}.log", support.room_lines(40))
        text = "robots:\n  - {id: alpha, lgo: alpha.log, egde: north}\n  - {id: beta, log: beta.log, edge: south}\nlasr: {engine: graph}\ncompose: {resolution: 0.1}\n"
        fixes = []
        for _ in range(8):
            self.write("team.yaml", text)
            done = self.mapweave("config", "check", "team.yaml", code=(DONE, BAD_INPUT))
            if done.returncode == DONE:
                break
            wrong, right = self.proposal(done.stderr)
            line = int(re.search(r"team\.yaml:(\d+)", done.stderr).group(1)) - 1
            lines = text.splitlines(keepends=True)
            self.assertIn(wrong, lines[line], "the line that is named holds the wrong word")
            lines[line] = lines[line].replace(wrong, right.split(".")[-1], 1)
            text = "".join(lines)
            fixes.append((wrong, right.split(".")[-1]))
        self.assertEqual(fixes, [("lgo", "log"), ("egde", "edge"), ("lasr", "laser"), ("resolution", "resolution_m")])
        done = self.mapweave("run", "team.yaml", "--out", "maps/team", code=(DONE, APART))   # one recording under two names
        self.assert_paths_are_there(done.stdout)
        self.assertEqual(sorted(sum(self.robots_in("maps/team").values(), [])), ["alpha", "beta"])
        self.assertEqual(Grid(next((self.folder / "maps/team").glob("team*/map.yaml"))).resolution_m, 0.1, "what was mended counts")

    def test_the_first_hour_from_the_help_to_files_that_are_explained(self):
        said = self.mapweave("help").stdout
        verbs = re.findall(r"^\| `(\w+)` \|", (support.ROOT / "README.md").read_text(), re.MULTILINE)
        self.assertGreater(len(verbs), 10)
        for verb in verbs:
            self.assertRegex(said, rf"(?m)^ +{verb} +\w", f"{verb} stands in the README")
        self.write_log("long.log", support.room_lines(80))
        self.mapweave("split", "long.log", "--robots", "2", "--overlap", "6", "--out", "logs")
        done = self.mapweave("run", "logs/run.yaml", "--out", "maps/team", code=(DONE, APART))
        self.assert_paths_are_there(done.stdout)
        self.assertEqual(len(sum(self.robots_in("maps/team").values(), [])), 2)
        guide = (support.ROOT / "apps/mapweave/guide/files.md").read_text()
        for path in (self.folder / "maps/team").rglob("*"):
            if path.is_file() and path.parent.name != "trajectories":
                self.assertIn(f"`{path.name}`", guide, f"{path.relative_to(self.folder)} is explained nowhere")
        # A second try does not destroy the first, and what is missing is named.
        self.assert_says(self.mapweave("run", "logs/run.yaml", "--out", "maps/team", code=support.CANNOT_WRITE), "maps/team", "--force")
        self.assert_whole("maps/team")
        self.assert_says(self.mapweave("slam", "logs/robot7.rawlog", "--out", "no", code=BAD_INPUT), "robot7.rawlog", "check its path")
        self.assert_nothing_left("no")



if __name__ == "__main__":
    support.main()
