#!/usr/bin/env python3
"""Do the names of the code hold together? Run by scripts/check_text; prints what is wrong, a line each, and exits with 1 then.

Public types (libs/*/include): a name stands for one type over all libraries; forward declarations and nested types do not count.
Identifiers and file names of libs, apps, test and scripts: none of the words that this project had of its own for what the field has a word for. The same for
the report's scripts (*.js), what shell scripts name, and services of ROS (*.srv).
Texts in the code of libs and apps, the reference of options, shell scripts, all pages (*.md; what stands in backticks may be an old name): none of them but for
those that are plain English as well.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

# The retired word, and what the field says.
RETIRED = {
    "flaw flaws": "problem; of a sensor: calibration (systematic errors)",
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
    "tie ties tied": "constraint",
}

# Plain English in a text ("either way", "focal lengths"), though not in a name.
PLAIN_IN_TEXTS = {"way", "ways", "tell", "tells", "lengths", "tie", "ties"}

# Identifiers, and texts that are nothing else, that have such a word for a reason.
EXCEPTIONS = {
    "bind": "databases' word for giving a statement its parameters (`core/sqlite.h`)",
    "bind_bytes": "as bind",
    "bind_text": "as bind",
    "bind_to_port": "a function of cpp-httplib",
    "bind_to_any_port": "as bind_to_port",
    "listen_after_bind": "as bind_to_port",
    "bindBuffer": "a function of WebGL",
    "tie": "std::tie",
    "lent_bytes": "a key of summary.json, which is read of earlier runs",
    "heard_bytes": "as lent_bytes",
}
NOT_OURS = re.compile(r"sqlite3_")
# Words that are retired together, in texts alone: the pattern, and what to say.
RETIRED_TOGETHER = {
    r"(?<!camera )\bmap servers?\b(?! \(server\.share\))": "camera map server (ROS's is map_server)",
}
# What holds the old names by its purpose.
OLD_NAMES = {"scripts/lib/check_names.py", "libs/core/src/renamed_options.cpp"}

TEXT = r'R"(?P<end>[^(\s]*)\(.*?\)(?P=end)"|"(?:\\.|[^"\\\n])*"'
NO_CODE = re.compile(TEXT + r"|//[^\n]*|/\*.*?\*/", re.DOTALL)
NO_JAVASCRIPT = re.compile(r"`(?:\\.|[^`\\])*`|'(?:\\.|[^'\\\n])*'|" + NO_CODE.pattern, re.DOTALL)
NO_SHELL = re.compile(r"(?:^|(?<=\s))#[^\n]*", re.MULTILINE)
SHELL_NAME = re.compile(r"\b([A-Za-z_]\w*)(?==|\(\)|\+=)|\b(?:local|for|read) ([A-Za-z_]\w*)")
CODE_FOLDERS = ("libs/", "apps/", "test/", "scripts/", "gui-less/", ".ci/")
NO_PYTHON = re.compile(r'"""(?:.|\n)*?"""|"(?:\\.|[^"\\\n])*"|#[^\n]*')
TYPE = re.compile(r"(?:class|struct|enum class|enum|union) ([A-Z]\w*)\b(?!::)(?!\s*;)|using ([A-Z]\w*) =")
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")

instead = {word: better for words, better in RETIRED.items() for word in words.split()}
problems = []


def listed(*patterns):
    names = subprocess.run(["git", "-C", ROOT, "-c", f"safe.directory={ROOT}", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *patterns],
                           capture_output=True, text=True, check=True).stdout.split("\0")
    return [pathlib.Path(name) for name in sorted(set(names)) if name and (ROOT / name).is_file()]


def code_of(file):
    """The numbered lines of a source, without comments and texts."""
    no_code = {".py": NO_PYTHON, "": NO_PYTHON, ".js": NO_JAVASCRIPT, ".srv": NO_SHELL}.get(file.suffix, NO_CODE)
    return enumerate(no_code.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), (ROOT / file).read_text()).splitlines(), 1)


def texts_of(file):
    """The numbered texts that users may see: those in a source's code; of any other file each line."""
    text = (ROOT / file).read_text()
    if file.suffix == ".js":
        text = re.sub(r"\$\{[^}]*\}", "", text)  # code in a text
        return [(text.count("\n", 0, found.start()) + 1, found.group()) for found in NO_JAVASCRIPT.finditer(text) if not found.group().startswith("/")]
    if file.suffix == ".md":
        return enumerate(re.sub(r"`[^`\n]*`", "", text).splitlines(), 1)
    if file.suffix not in (".h", ".cpp"):
        return enumerate(text.splitlines(), 1)
    texts, end = [], None
    for found in NO_CODE.finditer(text):
        if found.group().startswith("/"):
            continue
        if end is not None and not text[end:found.start()].strip():  # goes on from the line before
            texts[-1] = (texts[-1][0], texts[-1][1][:-1] + found.group()[1:])
        else:
            texts.append((text.count("\n", 0, found.start()) + 1, found.group()))
        end = found.end()
    return texts


def scripts_of(language):
    """Files without a suffix whose first line names what runs them."""
    return [file for file in listed(*CODE_FOLDERS) if not file.suffix and re.match(rb"#!.*\b" + language, (ROOT / file).read_bytes()[:80])]


def shell_scripts():
    return [*listed("*.sh"), *scripts_of(rb"(?:ba|da)?sh\b")]


def check_public_types():
    known = {}
    for file in listed("libs/*/include/*.h"):
        for number, line in code_of(file):
            if declared := TYPE.match(line):
                name = declared.group(1) or declared.group(2)
                if name in known:
                    problems.append(f"{file}:{number}: the public type {name} stands in {known[name]} too; a name says whose it is")
                known.setdefault(name, f"{file}:{number}")


def retired_in(name, known=()):
    return next((word for word in map(str.lower, WORD.findall(name)) if word in instead and word not in known), None)


def check_identifiers():
    kinds = ("*.h", "*.cpp", "*.py", "*.proto", "*.js", "*.srv")
    for file in (*listed(*(folder + kind for folder in CODE_FOLDERS for kind in kinds)), *scripts_of(rb"python3")):
        if word := retired_in(file.stem):
            problems.append(f"{file}: '{word}' in its name; say: {instead[word]}")
        if str(file) in OLD_NAMES:
            continue
        for number, line in code_of(file):
            for name in re.findall(r"\b[A-Za-z_]\w*", line):
                if name not in EXCEPTIONS and not NOT_OURS.match(name) and (word := retired_in(name)):
                    problems.append(f"{file}:{number}: '{word}' in {name}; say: {instead[word]}")


    for file in shell_scripts():
        for number, line in enumerate(NO_SHELL.sub("", (ROOT / file).read_text()).splitlines(), 1):
            for names in SHELL_NAME.findall(line):
                if word := retired_in("".join(names)):
                    problems.append(f"{file}:{number}: '{word}' in {''.join(names)}; say: {instead[word]}")


def check_texts():
    for file in (*listed("libs/*.h", "libs/*.cpp", "apps/*.h", "apps/*.cpp", "libs/*.js", "apps/*.srv", "*.md", "configs/*.yaml"), *shell_scripts()):
        if str(file) in OLD_NAMES:
            continue
        for number, text in texts_of(file):
            if text.strip('"') not in EXCEPTIONS and (word := retired_in(text, PLAIN_IN_TEXTS)):
                problems.append(f"{file}:{number}: '{word}' in a text; say: {instead[word]}")
            for words, better in RETIRED_TOGETHER.items():
                if found := re.search(words, text, re.IGNORECASE):
                    problems.append(f"{file}:{number}: '{found.group()}' in a text; say: {better}")


def main():
    check_public_types()
    check_identifiers()
    check_texts()
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
