"""Manual pages that are made of the help, units and configuration of services: they fit the program."""
import gzip
import re
import shlex
import shutil
import subprocess
import unittest

import support

GUI_LESS = support.ROOT / "gui-less"


class Packaging(support.Scenario):
    def test_each_verb_has_a_manual_page_with_all_of_its_options(self):
        subprocess.run([support.ROOT / "scripts/man_pages", "man", support.PROGRAM, GUI_LESS / "systemd/mapweave-batch"], cwd=self.folder, check=True, timeout=60)
        pages = {page.name.removesuffix(".1.gz"): gzip.decompress(page.read_bytes()).decode().replace("\\-", "-") for page in self.folder.glob("man/*")}
        verbs = re.findall(r"^  (\w+)  ", self.mapweave("--help").stdout.split("Verbs:")[1], re.MULTILINE)
        self.assertGreater(len(verbs), 10)
        self.assertEqual(set(pages), {"mapweave", "mapweave-batch", *(f"mapweave-{verb}" for verb in verbs)})
        for verb in verbs:
            options = set(re.findall(r"^  (-\S+)", self.mapweave(verb, "--help").stdout, re.MULTILINE))
            self.assertGreater(len(options), 0)
            for option in options:
                self.assertIn(f"\\fB{option}", pages[f"mapweave-{verb}"], verb)
        self.assertIn("mapweave serve edge [OPTIONS] CONFIG", pages["mapweave-serve"])

    @unittest.skipUnless(shutil.which("man"), "needs man, of the Debian package man-db")
    def test_manual_pages_render_without_a_warning(self):
        subprocess.run([support.ROOT / "scripts/man_pages", "man", support.PROGRAM, GUI_LESS / "systemd/mapweave-batch"], cwd=self.folder, check=True, timeout=60)
        for page in self.folder.glob("man/*"):
            done = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", page], capture_output=True, text=True, errors="replace", timeout=60,
                                  env=support.environment() | {"MANWIDTH": "80"}, check=True)
            self.assertEqual(done.stderr, "", page)
            self.assertIn("User Commands", done.stdout)

    def test_what_units_start_is_a_right_command_line_for_the_example(self):
        names = {"mapweave-edge@.service": "north", "mapweave-robot@.service": "alpha", "mapweave-cloud.service": "", "mapweave-coordinator.service": ""}
        started = {}
        for unit, name in names.items():
            command = re.search(r"^ExecStart=/usr/local/bin/mapweave (.*)$", (GUI_LESS / "systemd" / unit).read_text(), re.MULTILINE)[1]
            command = command.replace("%i", name).replace("/etc/mapweave/deployment.yaml", str(GUI_LESS / "deployment.yaml"))
            command = command.replace("/var/lib/mapweave", str(self.folder))
            method = ["--set", "coordinator.method=default"] if "coordinator" in unit else []
            started[unit] = self.start(*shlex.split(command), "--set", "live.broker=nats://127.0.0.1:9", *method)
        for unit, process in started.items():
            # What is absent here is found missing behind the command line and the configuration: the broker, or the recording.
            error = process.communicate(timeout=60 * support.PATIENCE)[1]
            code, words = (support.BAD_INPUT, "alpha.rawlog") if "robot" in unit else (support.UNANSWERED, "the broker cannot be reached")
            self.assertEqual(process.returncode, code, error)
            self.assertIn(words, error)


if __name__ == "__main__":
    support.main()
