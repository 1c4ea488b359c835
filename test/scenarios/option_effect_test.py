"""Every option has an effect: a small run is repeated with one option changed, and something in its results differs.
Those that may have none are listed with the reason, and printed.

The runs, the options and the values they are changed to stand in option_effect_cases.py. An option that is in no case fails the test.
All of it takes a quarter of an hour; --quick tries the options of QUICK_RUNS alone, and still that each option has a case.
Some options alone:  MAPWEAVE_PROGRAM=... python3 -B test/scenarios/option_effect_test.py 'rig\\.' 'visual\\.loops'
"""
import concurrent.futures
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading

import support
from determinism_test import TIMES, sealed, without
from option_effect_cases import CASES, QUICK_RUNS, RUNS, TOO_LARGE, WITHOUT_EFFECT
from option_effect_inputs import INPUTS, WRITTEN

JOBS = 2
MILLISECONDS = {"tracking_mean_ms", "tracking_p99_ms", "keyframe_mean_ms", "packing_mean_ms", "loop_seconds"}
SAYS_WHAT_WAS_SET = {"config.yaml", "manifest.json"}


def option_names(page):
    """The options on a reference page. Those of a list's elements stand in its example: robots.start.x_m."""
    names, path, sections = [], [], set()
    for line in page.splitlines():
        found = re.match(r"^([ #-]*)([a-z0-9_]+):(?:  # .*| \S.*)?$", line)
        if not found or ("#" in found[1] and "  # " not in line):
            continue
        column = len(found[1])
        path = [*(part for part in path if part[0] < column), (column, found[2])]
        names.append(".".join(part[1] for part in path))
        sections.add(".".join(part[1] for part in path[:-1]))
    return [name for name in names if name not in sections]


def without_numbers(key):
    return ".".join(part for part in key.split(".") if not part.isdigit())


def mapweave(*arguments):
    return subprocess.run([support.PROGRAM, *map(str, arguments)], env=support.environment(), text=True, errors="replace", check=False,
                          capture_output=True, timeout=300 * support.PATIENCE)


def in_hours(data):
    """Times over simulated wires, so coarse that what the processor takes is nothing."""
    if isinstance(data, list):
        return [in_hours(item) for item in data]
    if isinstance(data, dict):
        return {key: in_hours(value) for key, value in data.items() if isinstance(value, (dict, list)) or key in TIMES - {"load"}}
    return round(data / 3600.0) if isinstance(data, (int, float)) else data


def without_judgement_ids(results):
    """A judgement is named by its options too, whether or not they matter: what holds such names is left out."""
    kept = {name: content for name, content in results.items() if not name.endswith("map.mwdb")}
    return without(kept, {"witnesses", "contradicted"})


class Change:
    """A line of a case: an option, its other value, and what is set in both runs."""

    def __init__(self, run, line):
        change, _, common = line.partition(";")
        self.run, (self.key, self.value) = run, change.strip().split(" ", 1)
        self.option = without_numbers(self.key)
        self.common = tuple(re.findall(r"\S+=(?:\[.*?\](?= |$)|\S*)", common))


def changes():
    return [Change(run, line) for run, lines in CASES.items() for line in lines.strip().splitlines()]


class Laboratory:
    """Makes inputs and results when they are asked for, each once."""

    def __init__(self, folder):
        self.folder, self.made, self.lock = folder, {}, threading.Lock()
        self.places = {"written": folder / "written", **{name: folder / name for name in INPUTS}}
        for name, text in WRITTEN.items():
            path = self.places["written"] / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text if isinstance(text, bytes) else text.encode())

    def once(self, key, make):
        with self.lock:
            first = key not in self.made
            future = self.made.setdefault(key, concurrent.futures.Future())
        if first:
            try:
                future.set_result(make())
            except BaseException as error:  # pylint: disable=broad-except
                future.set_exception(error)
        return future.result()

    def placed(self, argument):
        for name in re.findall(r"\{([a-z]+)\}", argument):
            if name in INPUTS:
                self.once(name, lambda name=name: self.make_input(name))
        return re.sub(r"\{([a-z]+)\}", lambda found: str(self.places.get(found[1], found[0])), argument)

    def make_input(self, name):
        done = mapweave(*map(self.placed, INPUTS[name]), "--out", self.places[name])
        assert done.returncode in (support.DONE, support.APART), done.stderr

    def look(self, run, settings):
        """What the run leaves: every file but for times, the exit code, and the error where it is one."""
        verb, *words = map(self.placed, RUNS[run])
        flags = [flag for setting in [*(word for word in words if "=" in word), *map(self.placed, settings)] for flag in ("--set", setting)]
        arguments = [verb, *(word for word in words if "=" not in word), *flags]
        if verb == "timeline":
            done = mapweave(*arguments, "--json")
            assert done.returncode == support.DONE, done.stderr
            return {"printed": done.stdout, "error": ""}
        out = pathlib.Path(tempfile.mkdtemp(dir=self.folder)) / "out"
        done = mapweave(*arguments, "--threads", "1", "--out", out)
        # An engine that reaches its bound of memory ends the helper, with the exit code of what cannot be written.
        assert done.returncode != support.USAGE and (done.returncode != support.CANNOT_WRITE or "memory_limit_mb" in done.stderr), done.stderr
        files = {name: content for name, content in sealed(out).items() if name not in SAYS_WHAT_WAS_SET} if out.exists() else {}
        if "report.html" in files:
            files["report.html"] = ""   # it says what was set; whether it is there is an effect
        if "summary.json" in files:
            files["summary.json"] = without(files["summary.json"], MILLISECONDS)
            files["virtual times"] = in_hours(json.loads((out / "summary.json").read_text()).get("timeline", {}))
        shutil.rmtree(out.parent)
        failed = done.returncode not in (support.DONE, support.APART)
        messages = done.stderr if "laser.external.show_messages=true" in settings else ""
        return {"exit code": done.returncode, "error": done.stderr.strip().splitlines()[-1:] if failed else [], "messages": messages, **files}

    def differences(self, change):
        before = self.once((change.run, change.common), lambda: self.look(change.run, change.common))
        assert not before["error"], before["error"]
        after = self.look(change.run, (*change.common, f"{change.key}={change.value}"))
        if ".judge." in change.option:
            before, after = without_judgement_ids(before), without_judgement_ids(after)
        names = [name for name in {**before, **after} if before.get(name) != after.get(name)]
        return names, [before["error"], after["error"]]


class OptionEffect(support.Scenario):
    chosen = []
    quick = False

    def test_every_option_changes_something(self):
        reference = option_names(mapweave("config", "reference").stdout)
        tried = [change for change in changes() if (not self.quick or change.run in QUICK_RUNS) and
                 (not self.chosen or any(re.match(choice, change.option) for choice in self.chosen))]
        laboratory = Laboratory(self.folder)
        with concurrent.futures.ThreadPoolExecutor(JOBS) as pool:
            results = [(change, pool.submit(laboratory.differences, change)) for change in tried]
            for change, result in results:
                with self.subTest(change.option):
                    names, errors = result.result()
                    print(f"{change.run}: {change.key}={change.value}: {', '.join(names) or 'NOTHING'} {errors if any(errors) else ''}", flush=True)
                    if change.option in WITHOUT_EFFECT:
                        self.assertEqual(names, [], f"{change.key}={change.value}: {WITHOUT_EFFECT[change.option]}")
                    else:
                        self.assertTrue(names, f"{change.key}={change.value} changes nothing in the run '{change.run}'")
        if not self.chosen:
            known = {change.option for change in changes()} | set(WITHOUT_EFFECT) | set(TOO_LARGE)
            for option, reason in {**WITHOUT_EFFECT, **TOO_LARGE}.items():
                print(f"no effect is seen of {option}: {reason}")
            self.assertEqual([option for option in reference if option not in known], [], "options without a case in option_effect_cases.py")
            self.assertEqual(sorted(known - set(reference)), [], "cases of options that do not exist")


if __name__ == "__main__":
    OptionEffect.quick = "--quick" in sys.argv
    OptionEffect.chosen, sys.argv[1:] = [argument for argument in sys.argv[1:] if argument != "--quick"], []
    support.main()
