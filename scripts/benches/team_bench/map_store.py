"""Robots' own maps, each made once: a map depends on the mapping code, the log and the cut, not on fusion.

A map is made again where the program is another one, unless maps are kept (--keep-maps) or a stamp is given for programs that map alike
(--program-stamp).
"""
import json
import pathlib
import shutil
import threading

from benches.team_bench.program import QUIET


class MapStore:
    def __init__(self, folder, program, stamp=None, keep=False):
        self.folder, self.program, self.keep = pathlib.Path(folder), program, keep
        self.stamp = stamp or program.stamp()
        self._locks, self._lock = {}, threading.Lock()

    def _lock_of(self, folder):
        with self._lock:
            return self._locks.setdefault(folder, threading.Lock())

    def _is_made(self, folder, names):
        try:
            info = json.loads((folder / "info.json").read_text())
        except (OSError, ValueError):
            return None
        good = (self.keep or info["stamp"] == self.stamp) and all((folder / f"{name}.mwdb").exists() for name in names)
        return info if good else None

    def maps(self, cut):
        """Paths of the cut's maps in the order of its robots, named after them; and what mapping took."""
        return self.made(f"{cut.log}/{cut.key()}", cut.robot_names(), lambda folder: cut.write_parts(self.program, folder))

    def made(self, key, names, write_logs):
        """The same for any logs: `write_logs(folder)` gives a path for each name."""
        folder = self.folder / key
        with self._lock_of(folder):
            info = self._is_made(folder, names)
            if info is None:
                info = self._make(folder, names, write_logs)
        return [folder / f"{name}.mwdb" for name in names], info

    def _make(self, folder, names, write_logs):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        info = {"stamp": self.stamp, "robots": []}
        for name, log in zip(names, write_logs(folder / "logs")):
            done = self.program("slam", log, "--robot", name, "--threads", 1, "--out", folder / "one", "--force", *QUIET)
            robot = json.loads((folder / "one/summary.json").read_text())["robots"][0]
            (folder / "one/map.mwdb").rename(folder / f"{name}.mwdb")
            (folder / "one/trajectory.tum").rename(folder / f"{name}.tum")
            info["robots"].append({"name": name, "cpu_s": done.cpu_s, "wall_s": done.wall_s, "mapping_cpu_s": robot["cpu_seconds"], "scans": robot["scans"],
                                   "log_s": robot["log_seconds"], "peak_bytes": done.peak_bytes})
            shutil.rmtree(folder / "one")
        shutil.rmtree(folder / "logs", ignore_errors=True)
        (folder / "info.json").write_text(json.dumps(info, indent=2) + "\n")
        return info
