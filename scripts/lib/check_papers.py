#!/usr/bin/env python3
"""Do the papers hold together? Run by scripts/check_text; prints what is wrong, a line each, and exits with 1 then.

Every *.md: relative links lead to files, and #anchors to headings. README.md: at most 150 lines, its ten results as datasets/RESULTS.md has them.
libs/README.md: the arrows are those of libs/*/CMakeLists.txt, files and functions in backticks exist. libs/*/README.md: every public header is named.
DECISIONS.md: at most ten lines of 180 columns each. Whatever names one of its entries by number names one that is there.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "scripts"))
from benches import ten_results  # noqa: E402

problems = []


def listed(*patterns):
    names = subprocess.run(["git", "-C", ROOT, "-c", f"safe.directory={ROOT}", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *patterns],
                           capture_output=True, text=True, check=True).stdout.split("\0")
    return [ROOT / name for name in sorted(set(names)) if name and (ROOT / name).is_file()]


def shown(path):
    return path.relative_to(ROOT)


def lines_of(path):
    """The numbered lines of a page, those of code blocks left out."""
    in_code = False
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.lstrip().startswith("```"):
            in_code = not in_code
        elif not in_code:
            yield number, line


def anchors_of(path):
    """As GitHub makes them of headings."""
    anchors = {}
    for _, line in lines_of(path):
        if heading := re.match(r"#+ (.*)", line):
            text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading.group(1)).lower()
            name = re.sub(r"[^\w\- ]", "", text).strip().replace(" ", "-")
            anchors[name] = anchors.get(name, 0) + 1
    return {name if i == 0 else f"{name}-{i}" for name, count in anchors.items() for i in range(count)}


def check_links(pages):
    for page in pages:
        for number, line in lines_of(page):
            for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", line)):
                if re.match(r"[a-z]+:", target):
                    continue
                name, _, anchor = target.partition("#")
                file = (page.parent / name).resolve() if name else page
                if not file.exists():
                    problems.append(f"{shown(page)}:{number}: the link '{target}' leads to no file")
                elif anchor and (file.suffix != ".md" or anchor not in anchors_of(file)):
                    problems.append(f"{shown(page)}:{number}: the link '{target}' leads to no heading")


def check_readme():
    readme = ROOT / "README.md"
    if (count := len(readme.read_text().splitlines())) > 150:
        problems.append(f"README.md has {count} lines; 150 are enough, the rest belongs into apps/mapweave/guide/")
    if ten_results.table() not in readme.read_text():
        problems.append("README.md: the ten results are not those of datasets/RESULTS.md; scripts/bench ten-results writes them")


def check_map_of_the_house():
    page = ROOT / "libs/README.md"
    text = page.read_text()
    drawn = {name: {used.strip() for used in uses.split(",") if used.strip()}
             for name, uses in re.findall(r"^\| \[(\w+)\]\(\w+/README\.md\) \|[^|]*\|([^|]*)\|$", text, re.MULTILINE)}
    built = {}
    for file in listed("libs/*/CMakeLists.txt"):
        uses = re.search(r"mapweave_add_library\((\w+)(?:\s+USES((?:\s+[a-z]+)+))?", file.read_text())
        built[uses.group(1)] = set((uses.group(2) or "").split())
    for name in sorted(drawn.keys() | built.keys()):
        if drawn.get(name) != built.get(name):
            problems.append(f"libs/README.md: {name} uses {', '.join(sorted(built.get(name, []))) or 'nothing'} in CMake, "
                            f"{', '.join(sorted(drawn.get(name, []))) or 'nothing'} in the table")
    files = [str(shown(file)) for file in listed("libs", "apps", "datasets", "test")]
    known = "\n".join((ROOT / file).read_text() for file in files if re.match(r"(libs|apps)/.*\.(h|cpp)$", file))
    for number, line in lines_of(page):
        for name in re.findall(r"`([^`\s]+)`", line):
            if function := re.fullmatch(r"(?:(\w+)::)?(\w+)\(\)", name):
                if not all(re.search(rf"\b{part}\b", known) for part in function.groups() if part):
                    problems.append(f"libs/README.md:{number}: there is no {name}")
            elif re.fullmatch(r"[\w/]+\.(h|cpp|proto)", name) and not any(is_of(file, name) for file in files):
                problems.append(f"libs/README.md:{number}: there is no {name}")


def is_of(file, name):
    """`maps/map.h` is libs/maps/include/mapweave/maps/map.h, `fuse.cpp` any file of that name."""
    return f"/{file}".endswith(f"/{name}") or (name.count("/") == 1 and f"/{file}".endswith("/mapweave/" + name))


def check_headers():
    for file in listed("libs/*/include/*.h"):
        library = shown(file).parts[1]
        if not re.search(rf"`(?:{library}/)?{re.escape(file.name)}`", (ROOT / "libs" / library / "README.md").read_text()):
            problems.append(f"libs/{library}/README.md: does not name {file.name}, a header of its library")


def check_decisions():
    entries = re.split(r"^## ", (ROOT / "DECISIONS.md").read_text(), flags=re.MULTILINE)[1:]
    for entry in entries:
        title, *lines = entry.rstrip().splitlines()
        if len(lines) > 10 or any(len(line) > 180 for line in lines):
            problems.append(f"DECISIONS.md: '{title}' is longer than ten lines of 180 columns")
    numbers = [entry.split(".")[0] for entry in entries]
    if numbers != [str(number) for number in range(1, len(numbers) + 1)]:
        problems.append("DECISIONS.md: the numbers do not rise one by one")
    for file in listed("*.md", "*.h", "*.cpp", "*.proto", "*.py", "*.cmake", "*CMakeLists.txt", "*.yaml"):
        for found in re.finditer(r"\bDECISIONS(?:\.md,)?[\s/#]+([NX?]+\b|\d+(?:, \d+)*)", text := file.read_text()):
            for number in found.group(1).split(", "):
                if number not in numbers:
                    line = text.count("\n", 0, found.start()) + 1
                    problems.append(f"{shown(file)}:{line}: DECISIONS.md has no entry {number}")


def main():
    check_links(listed("*.md"))
    check_readme()
    check_map_of_the_house()
    check_headers()
    check_decisions()
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
