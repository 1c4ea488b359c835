"""out/bench/report.html: one page of the figures of all benches that were run here; it opens from the disk and loads nothing

Benches that draw figures write the page themselves. It is made of what they keep in out/bench/*.json, by the scripts of `mapweave report`.
"""
import base64
import hashlib
import html
import json
import math
import re

from benches import common

PAGE = common.ROOT / "libs/report/page"
SCRIPTS = ("basics.js", "charts.js", "again_section.js", "figures_section.js", "main.js")


def add_arguments(_parser):
    pass


def page_text(title, data):
    """The page; its policy allows its own style and script by their hashes, and nothing else."""
    def policy_hash(text):
        return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    style = (PAGE / "page.css").read_text()
    script = "(() => {\n'use strict';\n" + "".join((PAGE / name).read_text() for name in SCRIPTS) + "})();\n"
    escaped = json.dumps(data, allow_nan=False).replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    values = {"title": html.escape(title), "style": style, "style hash": policy_hash(style), "script": script, "script hash": policy_hash(script), "data": escaped,
              "connections": "", "footer": "Written by mapweave. This file holds everything that it shows and loads nothing."}
    return re.sub(r"\{\{([a-z ]+)\}\}", lambda found: values[found.group(1)], (PAGE / "page.html").read_text())


def shown(figure):
    """Figures as benches keep them, for the page: points by x, without those that have no number."""
    series = [{"name": name, "points": sorted([x, y] for x, y in points if math.isfinite(x) and math.isfinite(y))} for name, points in figure["series"].items()]
    return {**figure, "series": [one for one in series if one["points"]]}


def benches(folder):
    found = []
    for path in sorted(folder.glob("*.json")):
        kept = json.loads(path.read_text())
        figures = [one for one in map(shown, kept.get("figures", []) if isinstance(kept, dict) else []) if one["series"]]
        if figures:
            found.append({"name": path.stem, "machine": kept["machine"], "commit": kept["commit"], "figures": figures})
    return found


def write(folder=common.OUT):
    """The page's path; none where no bench of the folder has figures."""
    found = benches(folder)
    if not found:
        return None
    path = folder / "report.html"
    path.write_text(page_text("mapweave bench: " + ", ".join(bench["name"] for bench in found),
                              {"benches": found, "commands": [f"scripts/bench {bench['name']}" for bench in found], "inputs": [], "versions": {}}))
    return path


def run(_arguments):
    path = write()
    if path is None:
        common.give_up("no bench left figures in out/bench; run scripts/bench scheduling or recslam first")
    print(f"page: {path.relative_to(common.ROOT)}")
    return 0
