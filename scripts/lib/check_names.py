#!/usr/bin/env python3
"""Do the names of the code hold together? Run by scripts/check_text; prints what is wrong, a line each, and exits with 1 then.

Public types (libs/*/include): a name stands for one type over all libraries; forward declarations and nested types do not count.
Identifiers and file names of libs and apps: none of the words that this project had of its own for what the field has a word for.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

# The retired word, and what the field says.
RETIRED = {
    "flaws": "calibration (systematic errors of a sensor)",
    "lend lends lent lending lender lenders": "share, shared, borrowed",
    "hearsay": "claimed sightings",
    "joining joinings": "merge",
    "sibling siblings": "cameras of a rig",
    "mounting mountings": "extrinsics",
    "bind binds binding bindings": "align, alignment",
    "straighten straightens straightened straightening": "correct, loop correction",
    "companion companions": "covisible",
    "stray strays": "outlier",
    "heir heirs": "new parent",
    "young": "recent",
    "adopt adopts adopted": "re-anchored",
    "errand errands": "judging task",
    "tell tells told telling": "publish, send, report; a result is what it holds",
    "hear hears heard": "receive, received",
    "way ways": "trajectory, path, motion",
    "lengths": "scale",
}

# Identifiers that have such a word for a reason.
EXCEPTIONS = {
    "LentLandmark": "a message of maps/proto/mapweave.proto",
    "bind": "SQLite's word for a statement's parameter",
    "bind_bytes": "as bind",
    "bind_text": "as bind",
    "sqlite3_bind_blob64": "SQLite's",
    "sqlite3_bind_double": "SQLite's",
    "sqlite3_bind_int64": "SQLite's",
    "sqlite3_bind_text64": "SQLite's",
    "sqlite3_clear_bindings": "SQLite's",
}

NO_CODE = re.compile(r'R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
TYPE = re.compile(r"(?:class|struct|enum class|enum|union) ([A-Z]\w*)\b(?!::)(?!\s*;)|using ([A-Z]\w*) =")
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")

instead = {word: better for words, better in RETIRED.items() for word in words.split()}
problems = []


def listed(*patterns):
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard", *patterns],
                           capture_output=True, text=True, check=True).stdout.split("\0")
    return [pathlib.Path(name) for name in sorted(set(names)) if name and (ROOT / name).is_file()]


def code_of(file):
    """The numbered lines of a source, without comments and texts."""
    text = NO_CODE.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), (ROOT / file).read_text())
    return enumerate(text.splitlines(), 1)


def check_public_types():
    known = {}
    for file in listed("libs/*/include/*.h"):
        for number, line in code_of(file):
            if declared := TYPE.match(line):
                name = declared.group(1) or declared.group(2)
                if name in known:
                    problems.append(f"{file}:{number}: the public type {name} stands in {known[name]} too; a name says whose it is")
                known.setdefault(name, f"{file}:{number}")


def retired_in(name):
    return next((word for word in map(str.lower, WORD.findall(name)) if word in instead), None)


def check_words():
    for file in listed("libs/*.h", "libs/*.cpp", "apps/*.h", "apps/*.cpp"):
        if word := retired_in(file.stem):
            problems.append(f"{file}: '{word}' in its name; say: {instead[word]}")
        for number, line in code_of(file):
            for name in re.findall(r"\b[A-Za-z_]\w*", line):
                if name not in EXCEPTIONS and (word := retired_in(name)):
                    problems.append(f"{file}:{number}: '{word}' in {name}; say: {instead[word]}")


def main():
    check_public_types()
    check_words()
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
