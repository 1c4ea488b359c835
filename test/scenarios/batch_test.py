"""gui-less/systemd/mapweave-batch: jobs in, maps out, each once, whatever happens in between."""
import fcntl
import os
import pathlib
import signal
import subprocess
import time
import unittest

import support

SCRIPT = support.ROOT / "gui-less/systemd/mapweave-batch"

# Stands in for `mapweave run CONFIG --out DIR --force`: notes what it was asked, then does what the job's name says.
FAKE = """#!/bin/sh
echo "$*" >> "$FAKE_LOG"
cat "$2" >> "$FAKE_LOG"
case $2 in
  *bad*) echo "bad.rawlog at byte 7: cut short"; exit 3 ;;
  *apart*) code=4 ;;
  *slow*) trap 'exit 130' TERM; touch "$FAKE_LOG.slow"; i=0; while [ $i -lt 200 ]; do sleep 0.1; i=$((i + 1)); done; code=0 ;;
  *) code=0 ;;
esac
mkdir -p "$4" && echo "{}" > "$4/manifest.json"
exit $code
"""


class Batch(support.Scenario):
    def setUp(self):
        super().setUp()
        self.home = self.folder / "site one"   # a blank in the name, as people have them
        (self.home / "inbox").mkdir(parents=True)
        self.log = self.folder / "calls"
        self.fake = self.write("fake-mapweave", FAKE)
        self.fake.chmod(0o755)
        self.defaults = self.write("site.yaml", "laser: {engine: graph}\n")

    def environment(self, **more):
        return {**support.environment(), "PROGRAM": str(self.fake), "SETTLE_SECONDS": "0", "FAKE_LOG": str(self.log), **more}

    def batch(self, code=0, **more):
        done = subprocess.run([SCRIPT, self.home, self.defaults], env=self.environment(**more), text=True, capture_output=True, timeout=100, check=False)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def job(self, name, content=b"log"):
        path = self.home / "inbox" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        time.sleep(0.02)   # so that "changed during the last 0 seconds" is past
        return path

    def files(self, folder):
        return sorted(str(path.relative_to(self.home / folder)) for path in (self.home / folder).rglob("*") if path.is_file())

    def calls(self):
        return self.log.read_text() if self.log.exists() else ""

    def test_single_logs_and_teams_are_mapped_once_and_put_away(self):
        self.job("alpha.rawlog")
        self.job("team/b.clf.gz")
        self.job("team/a robot.rawlog")
        self.job("team/notes.txt")
        self.batch()
        self.assertEqual(self.files("inbox") + self.files("working"), [])
        self.assertEqual(self.files("done"), ["alpha.rawlog", "team/a robot.rawlog", "team/b.clf.gz", "team/notes.txt"])
        self.assertEqual(self.files("results"), ["alpha.rawlog/manifest.json", "alpha.rawlog/messages.txt", "team/manifest.json", "team/messages.txt"])
        calls = self.calls()
        self.assertIn("laser: {engine: graph}", calls)
        self.assertIn('{id: "alpha"', calls)
        self.assertLess(calls.index('{id: "a-robot", log: "' + str(self.home.resolve())), calls.index('{id: "b"'))
        self.batch()
        self.assertEqual(self.calls(), calls, "nothing is mapped twice")

    def test_folders_of_pictures_are_robots(self):
        self.job("walk/rgb.txt")
        self.job("walk/rgb/1.png")
        self.job("walk/notes.log")
        self.job("team/one/times.txt")
        self.job("team/one/image_0/000000.png")
        self.job("team/two/mav0/cam0/data.csv")
        self.job("team/three.rawlog")
        self.batch()
        self.assertEqual(self.files("failed"), [])
        walk, team = self.calls().split("run working/walk")[1].split("run working/team")[0], self.calls().split("run working/team")[1].split("run working/walk")[0]
        self.assertIn('{id: "walk", log: "' + str(self.home.resolve()) + '/working/walk"}', walk)
        self.assertEqual(walk.count("{id: "), 1, "what lies in a folder of pictures is no log of its own")
        for robot in ('{id: "one", log: ', '{id: "two", log: ', '{id: "three", log: '):
            self.assertIn(robot, team)
        self.assertEqual(team.count("{id: "), 3)

    def test_a_rawlog_is_mapped_with_the_pictures_of_its_cameras(self):
        self.job("alpha_Images/left_1.png")
        self.batch()
        self.assertEqual(self.calls(), "", "they wait for their log")
        self.assertIn("arriving  ", self.status())
        self.job("alpha.rawlog")
        self.batch()
        self.assertEqual(self.files("done"), ["alpha/alpha.rawlog", "alpha/alpha_Images/left_1.png"])
        self.assertEqual(self.files("inbox"), [])
        self.assertIn('{id: "alpha", log: "' + str(self.home.resolve()) + '/working/alpha/alpha.rawlog"}', self.calls())

    def status(self):
        done = subprocess.run([SCRIPT, "--status", self.home], env=self.environment(PROGRAM="/nowhere"), text=True, capture_output=True, check=False)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout

    def test_what_waits_and_what_failed_is_seen_at_a_glance(self):
        self.assertIn("waiting 0, arriving 0, working 0, done 0, failed 0; no batch is at work", self.status())
        self.job("bad.rawlog")
        self.job("good.rawlog")
        self.job("apart.rawlog")
        self.batch()
        self.job("next.rawlog")
        self.job("half.rawlog.part")
        status = self.status()
        self.assertIn("waiting 1, arriving 1, working 0, done 2, failed 1; no batch is at work", status)
        self.assertRegex(status, r"failed .* bad.rawlog .*at byte 7: cut short")
        self.assertRegex(status, r"done .* good.rawlog")
        self.job("slow.rawlog")
        (self.home / "inbox/next.rawlog").unlink()
        self.start_batch()
        self.assertIn("working 1, done 2, failed 1; a batch is at work", self.status())

    def test_prometheus_reads_how_many_jobs_there_are(self):
        self.job("bad.rawlog")
        self.job("good.rawlog")
        self.job("half.rawlog.part")
        before = int(time.time())
        self.batch()
        lines = (self.home / "metrics.prom").read_text().splitlines()
        for line in lines:
            self.assertRegex(line, r'^(# (HELP|TYPE) mapweave_batch_\w+ .+|mapweave_batch_\w+(\{state="[a-z]+"\})? [0-9.]+)$')
        values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
        for state, count in (("arriving", 1), ("waiting", 0), ("working", 0), ("done", 1), ("failed", 1)):
            self.assertEqual(values[f'mapweave_batch_jobs{{state="{state}"}}'], str(count), state)
        for name in ("last_look", "last_done", "last_failed"):
            self.assertGreaterEqual(int(values[f"mapweave_batch_{name}_timestamp_seconds"]), before, name)

    def test_the_page_of_all_jobs_takes_no_name_for_markup(self):
        self.job("<b>&\"x' ü%2.rawlog")
        self.job("bad <script>.rawlog")
        self.batch()
        page = (self.home / "index.html").read_text()
        self.assertIn("<p>0 waiting, 0 arriving, 0 working, 1 done, 1 failed.</p>", page)
        self.assertIn("&lt;b&gt;&amp;&quot;x' ü%2.rawlog", page)
        self.assertIn('href="results/%3Cb%3E%26%22x%27%20%C3%BC%252.rawlog/report.html"', page)
        self.assertIn('href="failed/bad%20%3Cscript%3E.rawlog.txt"', page)
        self.assertIn("at byte 7: cut short", page)
        self.assertNotIn("<script>", page)
        self.assertEqual([path.name for path in self.home.glob(".*.tmp")], [])

    def test_a_team_may_bring_its_own_configuration(self):
        self.job("team/run.yaml", b"robots: [{id: mine, log: x.rawlog}]\n")
        self.job("team/x.rawlog")
        self.batch()
        self.assertIn("run working/team/run.yaml", self.calls())
        self.assertIn(' --set laser.external.helper=""', self.calls(), "a job does not choose the program that runs")

    @unittest.skipUnless(support.PROGRAM.exists(), "the program is not built")
    def test_a_job_does_not_choose_the_program_that_runs(self):
        evil = self.job("team/evil", b"#!/bin/sh\ntouch " + str(self.folder).encode() + b"/ran\n")
        evil.chmod(0o755)
        self.job("team/room.log", ("\n".join(support.room_lines(5)) + "\n").encode())
        helper = f"{self.home}/working/team/evil"
        configuration = f"robots: [{{id: a, log: room.log}}]\nlaser: {{engine: icp, external: {{helper: '{helper}'}}}}\n"
        self.job("team/run.yaml", configuration.encode())
        self.batch(PROGRAM=str(support.PROGRAM))
        self.assertEqual(self.files("done"), ["team/evil", "team/room.log", "team/run.yaml"])
        self.assertFalse((self.folder / "ran").exists())

    def test_what_is_still_arriving_is_left_alone(self):
        self.job("half.rawlog.part")
        self.job("team/ok.rawlog")
        self.job("team/second.rawlog.partial")
        self.job(".hidden.rawlog")
        self.batch()
        self.job("fresh.rawlog")
        self.batch(SETTLE_SECONDS="60")
        self.assertEqual(self.calls(), "")
        (self.home / "inbox/team/second.rawlog.partial").rename(self.home / "inbox/team/second.rawlog")
        time.sleep(0.02)
        self.batch()
        self.assertEqual(self.files("inbox"), [".hidden.rawlog", "half.rawlog.part"])

    def test_a_job_that_fails_is_put_aside_with_its_message_and_the_next_goes_on(self):
        self.job("bad.rawlog")
        self.job("good.rawlog")
        self.job("nothing/readme.txt")
        self.batch()
        self.assertEqual(self.files("done"), ["good.rawlog"])
        self.assertEqual(self.files("failed"), ["bad.rawlog", "bad.rawlog.txt", "nothing.txt", "nothing/readme.txt"])
        self.assertIn("at byte 7", (self.home / "failed/bad.rawlog.txt").read_text())
        self.assertIn("exit code 3", (self.home / "failed/bad.rawlog.txt").read_text())
        self.assertIn("no log in it", (self.home / "failed/nothing.txt").read_text())

    def test_maps_that_stayed_apart_are_a_result(self):
        self.job("apart.rawlog")
        self.assertIn("stayed apart", self.batch().stderr)
        self.assertEqual(self.files("done"), ["apart.rawlog"])

    def test_a_name_that_comes_again_gets_a_number(self):
        for _ in range(3):
            self.job("alpha.rawlog")
            self.batch()
        self.assertEqual(self.files("done"), ["alpha-2.rawlog", "alpha-3.rawlog", "alpha.rawlog"])
        self.assertEqual(self.calls().count("run working/"), 3)

    def start_batch(self):
        """Starts it, and waits until the job `slow` is being mapped."""
        process = subprocess.Popen([SCRIPT, self.home, self.defaults], env=self.environment(), text=True, stderr=subprocess.PIPE, start_new_session=True)

        def end():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            process.stderr.close()
        self.addCleanup(end)
        deadline = time.monotonic() + 20
        while not pathlib.Path(f"{self.log}.slow").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        return process

    def test_two_never_work_at_once(self):
        self.job("slow.rawlog")
        first = self.start_batch()
        self.job("other.rawlog")
        self.assertIn("another", self.batch().stderr)
        self.assertEqual(self.calls().count("run working/"), 1)
        os.killpg(first.pid, signal.SIGKILL)

    def test_a_stop_leaves_the_job_for_the_next_time(self):
        self.job("slow.rawlog")
        first = self.start_batch()
        first.send_signal(signal.SIGTERM)
        self.assertEqual(first.wait(timeout=20), 130)
        self.assertEqual(self.files("results"), [])
        self.fake.write_text(FAKE.replace("*slow*)", "*never*)"))
        self.batch()
        self.assertEqual(self.files("done"), ["slow.rawlog"])

    def test_a_crash_is_survived_and_a_job_that_always_crashes_is_given_up(self):
        self.job("slow.rawlog")
        for _ in range(3):
            first = self.start_batch()
            os.killpg(first.pid, signal.SIGKILL)   # as a reboot would
            first.wait()
            pathlib.Path(f"{self.log}.slow").unlink()
        with open(self.home / ".lock") as lock:    # released by the kernel
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self.batch()
        self.assertEqual(self.files("failed"), ["slow.rawlog", "slow.rawlog.txt"])
        self.assertIn("given up", (self.home / "failed/slow.rawlog.txt").read_text())
        self.assertEqual(self.files("working"), [])

    def test_it_says_what_it_lacks(self):
        self.assertIn("cannot find the program", self.batch(code=1, PROGRAM="/nowhere/mapweave").stderr)
        self.assertEqual(subprocess.run([SCRIPT], capture_output=True, check=False).returncode, 2)
        done = subprocess.run([SCRIPT, self.folder / "lost"], env=self.environment(), capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, "lost" in done.stderr), (1, True))

    @unittest.skipUnless(support.PROGRAM.exists(), "the program is not built")
    def test_the_real_program_maps_what_arrives(self):
        self.job("room.log", ("\n".join(support.room_lines(30)) + "\n").encode())
        self.job("cut.rawlog", support.need(support.MALAGA).read_bytes()[:5000])
        self.batch(PROGRAM=str(support.PROGRAM))
        self.assertRegex(self.status(), r"done .* room.log +[0-9.]+ s")
        self.assertEqual(self.files("done"), ["room.log"])
        self.assertIn("team/map.png", "\n".join(self.files("results/room.log")))
        self.assertIn("cut.rawlog", (self.home / "failed/cut.rawlog.txt").read_text())


if __name__ == "__main__":
    support.main()
