"""What benches share: the program, the public logs, the tables of datasets/RESULTS.md."""
import json
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "build/release/bin/mapweave"
DATA = pathlib.Path(os.environ.get("MAPWEAVE_DATA", ROOT.parent / "shared/data"))
OUT = ROOT / "out/bench"
RESULTS = ROOT / "datasets/RESULTS.md"


def give_up(message, code=3):
    print(f"scripts/bench: {message}", file=sys.stderr)
    sys.exit(code)


def need(path, remedy):
    if not path.exists():
        give_up(f"there is no {path}; {remedy}")
    return path


def mapweave(*arguments, accepted=(0, 4)):
    """Runs the program; its exit code and standard output. Its progress goes to stderr as it comes."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in accepted:
        give_up(f"mapweave {' '.join(map(str, arguments))} ended with exit code {done.returncode}", done.returncode)
    return done.returncode, done.stdout


def machine():
    """Processors and their kind, without saying whose they are."""
    model = re.search(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    return f"{len(os.sched_getaffinity(0))} cores of {model.group(1).strip() if model else 'an unnamed processor'}"


def commit():
    def git(*arguments):
        return subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=False).stdout.strip()
    return (git("rev-parse", "--short", "HEAD") or "no commit") + (" with changes" if git("status", "--porcelain", "--", "libs", "apps") else "")


def table(headers, rows):
    lines = ["| " + " | ".join(headers) + " |", "|" + " --- |" * len(headers)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def write_results(name, text):
    """Replaces what stands between <!-- bench:name --> and <!-- /bench --> in RESULTS.md, and the ten results of README.md, which come from there."""
    replace_between(RESULTS, f"<!-- bench:{name} -->\n", "<!-- /bench -->", text)
    from benches import ten_results   # which uses this module
    ten_results.write()


def replace_between(file, begin, end, text):
    new, count = re.subn(f"({re.escape(begin)}).*?({re.escape(end)})", lambda match: match.group(1) + text + "\n" + match.group(2), file.read_text(), flags=re.DOTALL)
    if count != 1:
        give_up(f"{file.name} has {count} places {begin.strip()} ... {end}; one was expected")
    partial = file.with_suffix(".partial")
    partial.write_text(new)
    partial.replace(file)


def results_text(name, pattern="(?s).*"):
    """What matches between <!-- bench:name --> and <!-- /bench --> of RESULTS.md; nothing where nothing does."""
    found = re.search(rf"<!-- bench:{name} -->\n(.*?)<!-- /bench -->", RESULTS.read_text(), re.DOTALL)
    match = re.search(pattern, found.group(1)) if found else None
    return match.group(0) if match else ""


def tables_of(name):
    """The tables between <!-- bench:name --> and <!-- /bench --> of RESULTS.md, each a list of its lines' cells."""
    return [[[cell.strip() for cell in line.strip().strip("|").split(" |")] for line in lines.splitlines()]
            for lines in re.findall(r"(?:^\|[^\n]*\n)+", results_text(name), re.MULTILINE)]


def results_rows(name, headers):
    """The rows of the first of these tables, by their first cell; none where its columns are others."""
    first = next(iter(tables_of(name)), [[]])
    return {cells[0]: cells for cells in first[2:]} if first[0] == list(headers) else {}


def unmet(what, some):
    """Exit code of a bench in which `some` did not happen, so that their figures are left out: 5 and a message; 0 where there are none."""
    if some:
        print(f"scripts/bench: {what}: {', '.join(map(str, some))}", file=sys.stderr)
    return 5 if some else 0


def write_json(name, value):
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / f"{name}.json").write_text(json.dumps(value, indent=2) + "\n")
