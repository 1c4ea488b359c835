"""report.html: written by run, slam and merge, by plan and by benches; opened from the disk by a browser without an error or a request."""
import json
import shutil
import subprocess
import sys
import unittest

import browser
import report_inputs
import support
from support import BAD_INPUT, CANNOT_WRITE, DONE, USAGE

sys.path.insert(0, str(support.ROOT / "scripts"))
from benches import plots, report as bench_report   # noqa: E402

needs_browser = unittest.skipUnless(browser.chromium(), "chromium is not installed")
SECTIONS = {"map", "robots", "pairs", "timeline", "options", "again"}


class Report(support.Scenario):
    def results(self, robots=("alpha", "beta", "gamma"), cells=400, poses=200):
        folder = self.folder / "results"
        report_inputs.write_results(folder, robots, cells, poses)
        return folder

    def page(self, *arguments, code=DONE):
        self.mapweave("report", "results", *arguments, code=code)
        return self.folder / "results/report.html"

    def write_room(self, name):
        return self.write(name, "\n".join(support.room_lines(30)) + "\n")

    def edit(self, name, change):
        path = self.folder / "results" / name
        data = json.loads(path.read_text())
        change(data)
        path.write_text(json.dumps(data))

    def assert_quiet(self, page):
        """Nothing on the console, no request, no part that failed."""
        self.assertEqual(page.console, [])
        self.assertEqual(page.requests, [])
        self.assertEqual(page.value("document.querySelectorAll('section > .warning').length"), 0)


class Written(Report):
    def test_slam_run_and_merge_leave_a_page_that_report_writes_again(self):
        self.write_room("room.log")
        self.write("team.yaml", "robots:\n  - {id: alpha, log: room.log}\n")
        self.mapweave("slam", "room.log", "--out", "alone")
        self.mapweave("run", "team.yaml", "--out", "team")
        self.mapweave("merge", "team", "--out", "merged")
        for folder in ("alone", "team", "merged"):
            with self.subTest(folder):
                page = (self.folder / folder / "report.html").read_bytes()
                self.mapweave("report", folder, "--out", "again.html")
                self.assertEqual(page, (self.folder / "again.html").read_bytes())
                self.assertNotIn("report.html", self.read_json(f"{folder}/manifest.json")["outputs"])

    def test_no_page_where_none_is_wanted(self):
        self.write_room("room.log")
        self.mapweave("slam", "room.log", "--out", "alone", "--set", "output.report=false")
        self.assertFalse((self.folder / "alone/report.html").exists())

    def test_what_is_no_folder_of_results_is_refused(self):
        self.assert_says(self.mapweave("report", "nowhere", code=BAD_INPUT), "nowhere", "no folder of results")
        self.results()
        self.write("truth.tum", "1 0 0 0 0 0 0 1\n")
        self.assert_says(self.mapweave("report", "results", "--reference", "truth.tum", code=USAGE), "truth.tum", "several robots")

    @unittest.skipUnless(shutil.which("tidy"), "tidy is not installed")
    def test_the_page_is_valid_html(self):
        self.results()
        done = subprocess.run(["tidy", "-errors", "-quiet", "--show-warnings", "yes", self.page()], capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


@needs_browser
class Opened(Report):
    def test_without_error_or_request_at_three_sizes(self):
        self.results()
        path = self.page()
        for width, height in ((390, 800), (900, 700), (1600, 1000)):
            with self.subTest(width), browser.Browser(width, height) as page:
                page.open(path)
                page.settle()
                self.assert_quiet(page)
                self.assertEqual(set(page.value("[...document.querySelectorAll('section')].map(one => one.id)")), SECTIONS)
                self.assertLessEqual(page.value("document.documentElement.scrollWidth"), width, "the page is wider than the window")

    def test_every_pair_is_drawn_when_it_is_opened(self):
        self.results()
        with browser.Browser() as page:
            page.open(self.page())
            page.value("document.querySelectorAll('#pairs details').forEach(pair => { pair.open = true; })")
            page.settle()
            self.assertEqual(page.value("document.querySelectorAll('#pairs details canvas').length"), 3)
            self.assert_quiet(page)

    def test_by_keys_alone(self):
        self.results()
        with browser.Browser() as page:
            page.open(self.page())
            reached = set()
            for _ in range(60):
                page.press("Tab")
                reached.add(page.value("document.activeElement.tagName + '.' + document.activeElement.className"))
            self.assertTrue({"CANVAS.map-canvas", "SUMMARY.", "BUTTON."} <= reached, reached)
            page.value("document.querySelector('.map-canvas').focus()")
            picture = "document.querySelector('.map-canvas').toDataURL()"
            pictures = [page.value(picture)]
            for key in ("ArrowLeft", "+", "0", "["):
                page.press(key)
                page.settle()
                pictures.append(page.value(picture))
            self.assertEqual(len(set(pictures)), 4)
            self.assertEqual(pictures[0], pictures[3])
            page.press(" ")
            self.assertIn("Pause", page.value("document.querySelector('#map .bar button[aria-pressed=true]').textContent"))
            self.assert_quiet(page)

    def test_names_that_try_to_break_out_are_text(self):
        names = ("a<img src=x onerror=window.broken=1>", "\"'&<b>`${1}", "روبوت 機器人", "__proto__")
        self.results(names)
        self.edit("summary.json", lambda summary: summary["notes"].extend(["</script><script>window.broken=1</script>", "<!--", "\u2028"]))
        self.edit("manifest.json", lambda manifest: manifest["inputs"].append({"path": "javascript:window.broken=1", "sha256": "'\"><svg onload=window.broken=1>"}))
        with browser.Browser() as page:
            page.open(self.page())
            page.value("document.querySelectorAll('details').forEach(one => { one.open = true; })")
            page.settle()
            self.assert_quiet(page)
            self.assertEqual(page.value("typeof window.broken"), "undefined")
            self.assertEqual(page.value("document.querySelectorAll('img, script:not([type])').length"), 1)
            for name in names:
                self.assertIn(name, page.value("document.body.textContent"))

    def test_whatever_is_missing(self):
        everything = ("summary.json", "merges.json", "manifest.json", "config.yaml", "team", "robots/alpha", "robots")
        with browser.Browser() as page:
            for missing in everything:
                with self.subTest(missing):
                    path = self.results() / missing
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
                    page.open(self.page())
                    page.settle()
                    self.assert_quiet(page)
                    shutil.rmtree(self.folder / "results")

    def test_an_interrupted_run_and_a_robot_without_scans_say_so(self):
        self.results()

        def interrupt(summary):
            summary.update(interrupted=True, exit_code=130)
            summary["robots"].append({"id": "silent", "scans": 0, "mapped": False, "log_seconds": 0})
        self.edit("summary.json", interrupt)
        with browser.Browser() as page:
            page.open(self.page())
            self.assertIn("interrupted", page.value("document.querySelector('.outcome').textContent"))
            self.assertIn("no scans, no map", page.value("document.getElementById('robots').textContent"))
            self.assert_quiet(page)

    def test_errors_against_a_reference_of_a_tenth_of_the_run(self):
        folder = self.results(("alpha",))
        lines = (folder / "team/trajectories/alpha.tum").read_text().splitlines()
        self.write("truth/alpha.tum", "\n".join(lines[100:120]) + "\n")
        with browser.Browser() as page:
            page.open(self.page("--reference", "truth"))
            self.assertIn("20 of 200 poses (10 %)", page.value("document.getElementById('errors').textContent"))
            self.assert_quiet(page)

    def test_it_prints(self):
        self.results()
        with browser.Browser() as page:
            page.open(self.page())
            page.print_pdf(self.folder / "page.pdf")
            self.assertGreater((self.folder / "page.pdf").stat().st_size, 20000)
            self.assert_quiet(page)

    def test_forty_robots_and_ten_thousand_cells_a_side_open_soon(self):
        """In 2 s on an idle machine (0.8 s measured). Tests run beside others on machines of any speed: three times as long is a failure."""
        self.results([f"robot{i:02}" for i in range(40)], 10000, 2000)
        path = self.page()
        seconds = []
        for _ in range(3):
            with browser.Browser() as page:
                seconds.append(page.open(path))
                page.settle()
                self.assert_quiet(page)
        print(f"opened in {min(seconds):.2f} s")
        self.assertLess(min(seconds), 6.0 * support.PATIENCE, f"it took {seconds} s")


HOSTILE = ("a<img src=x onerror=window.broken=1>", "\"'&<b>`${1}", "</script><script>window.broken=1</script>", "روبوت 機器人", "__proto__", "{{data}}")
PLAIN = ("__proto__", "constructor", "a.b-c_" + 58 * "d")   # names of robots and edges are letters and digits; those of files are not


class OtherPages(Report):
    """Of plans and of benches: drawn by the same scripts, under the same policy."""

    def plan_page(self, robots=10, edges=3, *arguments, names=(), file="problem.json"):
        names = list(names) + [f"r{i}" for i in range(robots - len(names))]
        overlaps = [[a, b, 0.4 if i % edges == j % edges else 0.02] for i, a in enumerate(names) for j, b in enumerate(names[:i]) if (i + j) % 4 or i % edges == j % edges]
        self.write(file, json.dumps({"robots": names, "overlaps": overlaps, "robot_scans": {names[0]: 5000},
                                               "edges": [{"id": names[i], "bandwidth_bytes_per_s": 1e6 * (i + 1)} for i in range(edges)]}))
        done = self.mapweave("plan", file, "--report", "plan.html", *arguments)
        return self.folder / "plan.html", done

    def bench_page(self, name="fitted"):
        figures = [plots.figure("cut", "cut weight", "robots", "cut / default", {name: [(10, 1.5), (100, 2.5), (2000, 12)], "zero": [(10, 0), (2000, 1)]}, log_y=True),
                   plots.figure("time", "time", "scans", "s", {"measured": [(300, 0.5), (100, -0.25)], "nothing": []})]
        plots.draw(self.folder, figures)
        self.write("scheduling.json", json.dumps({"machine": name, "commit": name, "figures": figures}))
        self.write("accuracy.json", "[]")
        return bench_report.write(self.folder)

    def open_quietly(self, path, page, sections):
        page.open(path)
        page.value("document.querySelectorAll('details').forEach(one => { one.open = true; })")
        page.settle()
        self.assert_quiet(page)
        self.assertEqual(page.value("typeof window.broken"), "undefined")
        self.assertEqual(page.value("[...document.querySelectorAll('section')].map(one => one.id)"), sections)
        self.assertEqual(page.value("document.querySelectorAll('img').length"), 0)

    def test_a_plan_is_printed_as_before_and_its_page_is_the_same_each_time(self):
        path, done = self.plan_page()
        self.assertIn("page: plan.html", done.stdout)
        first = path.read_bytes()
        path, done = self.plan_page(10, 3, "--json")
        self.assertEqual(first, path.read_bytes())
        self.assertEqual(len(json.loads(done.stdout)["placement"]), 10)
        self.mapweave("plan", "problem.json", "--report", "absent/plan.html", code=CANNOT_WRITE)

    @unittest.skipUnless(shutil.which("tidy"), "tidy is not installed")
    def test_they_are_valid_html(self):
        for page in (self.plan_page(6, 3, names=PLAIN, file=HOSTILE[0])[0], self.bench_page(HOSTILE[0])):
            done = subprocess.run(["tidy", "-errors", "-quiet", "--show-warnings", "yes", page], capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stderr), (0, ""))

    @needs_browser
    def test_a_plan_shows_groups_times_links_and_bound_at_three_sizes(self):
        path, _ = self.plan_page(40, 4)
        for width, height in ((390, 800), (900, 700), (1600, 1000)):
            with self.subTest(width), browser.Browser(width, height) as page:
                self.open_quietly(path, page, ["groups", "times", "loads", "method", "again"])
                self.assertLessEqual(page.value("document.documentElement.scrollWidth"), width, "the page is wider than the window")
                self.assertEqual(page.value("document.querySelectorAll('.graph > circle, .graph > polygon').length"), 40)
                forms = page.value("[...document.querySelectorAll('#groups .key polygon, #groups .key circle')].map(one => one.tagName + (one.getAttribute('points') || ''))")
                self.assertEqual(len(set(forms)), 4, "edges are told apart without colours")
                self.assertIn("no plan is below", page.value("document.getElementById('method').textContent"))
                self.assertEqual(page.value("document.querySelectorAll('#times svg.chart text[text-anchor=end]').length"), 40 + 4 + 1)

    @needs_browser
    def test_names_that_try_to_break_out_are_text_there_too(self):
        with browser.Browser() as page:
            for name in HOSTILE:
                file = name.replace("/", "")
                self.open_quietly(self.plan_page(6, 3, names=PLAIN, file=file)[0], page, ["groups", "times", "loads", "method", "again"])
                for text in (file, *PLAIN):
                    self.assertIn(text, page.value("document.body.textContent"))
                self.open_quietly(self.bench_page(name), page, ["bench-0", "again"])
                self.assertIn(name, page.value("document.getElementById('bench-0').textContent"))

    @needs_browser
    def test_one_robot_alone_and_thousands_have_a_page(self):
        with browser.Browser() as page:
            for robots, path in ((1, lambda: self.plan_page(1, 1)[0]), (2, lambda: self.plan_page(2, 2)[0]), (3000, self.large_plan)):
                with self.subTest(robots):
                    self.open_quietly(path(), page, ["groups", "times", "loads", "method", "again"])

    def large_plan(self):
        names = [f"r{i}" for i in range(3000)]
        self.write("large.json", json.dumps({"robots": names, "overlaps": [[names[i], names[i + j], 0.1 * j] for i in range(2995) for j in (1, 2, 4)],
                                             "edges": [{"id": f"e{i}", "bandwidth_bytes_per_s": 1e6} for i in range(12)]}))
        self.mapweave("plan", "large.json", "--report", "large.html")
        return self.folder / "large.html"

    @needs_browser
    def test_a_bench_s_figures_are_drawn_with_a_sign_for_each_point(self):
        with browser.Browser() as page:
            path = self.bench_page()
            self.assertEqual(path.name, "report.html")
            self.open_quietly(path, page, ["bench-0", "again"])
            self.assertEqual(page.value("[...document.querySelectorAll('#bench-0 svg.chart')].map(one => one.querySelectorAll('circle, polygon').length)"), [4, 2])


if __name__ == "__main__":
    support.main()
