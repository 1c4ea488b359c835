"""What benches share: the program, the public logs, tables in README.md."""
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


def write_readme(name, text):
    """Replaces what stands between <!-- bench:name --> and <!-- /bench --> in README.md."""
    readme = ROOT / "README.md"
    pattern = re.compile(rf"(<!-- bench:{name} -->\n).*?(<!-- /bench -->)", re.DOTALL)
    new, count = pattern.subn(lambda match: match.group(1) + text + "\n" + match.group(2), readme.read_text())
    if count != 1:
        give_up(f"README.md has {count} places <!-- bench:{name} --> ... <!-- /bench -->; one was expected")
    partial = readme.with_suffix(".partial")
    partial.write_text(new)
    partial.replace(readme)


def readme_rows(name, headers):
    """The cells of the first table between <!-- bench:name --> and <!-- /bench -->, by their first one; none where its columns are others."""
    found = re.search(rf"<!-- bench:{name} -->\n((?:\|[^\n]*\n)*)", (ROOT / "README.md").read_text(), re.DOTALL)
    lines = [[cell.strip() for cell in line.strip("|").split(" |")] for line in found.group(1).splitlines() if line.startswith("|")] if found else []
    return {cells[0]: cells for cells in lines[2:]} if lines and lines[0] == list(headers) else {}


def readme_text(name, pattern):
    """What matches between <!-- bench:name --> and <!-- /bench -->; nothing where nothing does."""
    found = re.search(rf"<!-- bench:{name} -->\n(.*?)<!-- /bench -->", (ROOT / "README.md").read_text(), re.DOTALL)
    match = re.search(pattern, found.group(1)) if found else None
    return match.group(0) if match else ""


def unmet(what, some):
    """Exit code of a bench in which `some` did not happen, so that their figures are left out: 5 and a message; 0 where there are none."""
    if some:
        print(f"scripts/bench: {what}: {', '.join(map(str, some))}", file=sys.stderr)
    return 5 if some else 0


def write_json(name, value):
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / f"{name}.json").write_text(json.dumps(value, indent=2) + "\n")
