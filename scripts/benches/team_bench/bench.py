"""What every part works with: programs, maps, results that outlive a partial run, and work side by side."""
import concurrent.futures
import json
import pathlib
import shutil

from benches import common
from benches.team_bench.map_store import MapStore
from benches.team_bench.program import QUIET, Failed, Program


class Bench:
    def __init__(self, arguments):
        self.arguments = arguments
        self.out = pathlib.Path(arguments.out)
        self.folder = self.out / "teams"
        self.program = Program(arguments.program)
        self.store = MapStore(arguments.maps or self.folder / "maps", self.program, arguments.program_stamp, arguments.keep_maps)
        self.missed = []

    def scratch(self, *names):
        folder = self.folder.joinpath("runs", *names)
        folder.parent.mkdir(parents=True, exist_ok=True)
        return folder

    def merge(self, maps, out, *flags, threads=1, quiet=True):
        """Merges maps into `out`; what it took, its summary and its verdicts."""
        done = self.program("merge", *maps, "--out", out, "--force", "--threads", threads, *(QUIET if quiet else ()), *flags)
        return done, json.loads((out / "summary.json").read_text()), json.loads((out / "merges.json").read_text())

    def picture(self, maps, name, *flags):
        """The team's maps drawn; kept below out/teams/pictures."""
        if self.arguments.no_pictures:
            return
        out = self.scratch("drawn", name)
        self.merge(maps, out, "--set", "output.pcd=false", "--set", "output.pgm=false", "--set", "output.report=false", *flags, quiet=False)
        self.keep_pictures(out, name)

    def keep_pictures(self, out, name):
        kept = self.folder / "pictures"
        kept.mkdir(parents=True, exist_ok=True)
        for path in [*sorted(out.glob("team*/map.color.png")), *sorted(out.glob("team*/conflicts.png"))]:
            shutil.copyfile(path, kept / f"{name}-{path.parent.name}-{path.name}")
        shutil.rmtree(out, ignore_errors=True)

    def side_by_side(self, work, items):
        """work(item) of each, --jobs at a time, in the order of items; a failed one gives its Failed."""
        def guarded(item):
            try:
                return work(item)
            except Failed as failed:
                return failed
        with concurrent.futures.ThreadPoolExecutor(max(1, self.arguments.jobs)) as pool:
            yield from zip(items, pool.map(guarded, items))

    def _stored(self):
        path = self.out / "teams.json"
        return json.loads(path.read_text()) if path.exists() else {}

    def stored_parts(self):
        """What parts kept, of this run and earlier ones."""
        return self._stored().get("parts", {})

    def keep(self, part, rows, **numbers):
        """Rows of this run beside those of earlier ones; all of them."""
        stored = self._stored()
        parts = stored.setdefault("parts", {})
        kept = parts.get(part, {}).get("rows", {})
        stamp = self.program.stamp()
        kept.update({key: {**row, "program": stamp} for key, row in rows.items()})
        parts[part] = {"machine": common.machine(), "commit": common.commit(), "rows": kept, **numbers}
        self._write(stored)
        return kept

    def _write(self, stored):
        self.out.mkdir(parents=True, exist_ok=True)
        partial = self.out / "teams.json.partial"
        partial.write_text(json.dumps(stored, indent=1) + "\n")
        partial.replace(self.out / "teams.json")

    def table(self, part, title, headers, rows):
        """Printed, and kept for RESULTS.md."""
        text = common.table(headers, rows)
        print(text, flush=True)
        stored = self._stored()
        stored.setdefault("tables", {}).setdefault(part, {})[title] = text
        self._write(stored)

    def tables(self, parts):
        """{title: table}: what was printed last of each part, in this order."""
        kept = self._stored().get("tables", {})
        return {title: text for part in parts for title, text in kept.get(part, {}).items()}

    def gate(self, part, what, value, goal, holds):
        """Says whether a goal is met; a missed one is remembered."""
        line = f"{part}: {what}: {value}; goal {goal}: {'met' if holds else 'MISSED'}"
        print(line, flush=True)
        if not holds:
            self.missed.append(line)
