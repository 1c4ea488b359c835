"""Runs of the program, one thread each, with what they took."""
import hashlib
import os
import pathlib
import subprocess
import tempfile
import time

from benches import common

QUIET = ("--set", "output.png=false", "--set", "output.pcd=false", "--set", "output.pgm=false", "--set", "output.report=false")


class Failed(Exception):
    """The program ended otherwise than expected; its last words."""


class Done:
    def __init__(self, code, stdout, usage, wall_s):
        self.code, self.stdout, self.wall_s = code, stdout, wall_s
        self.cpu_s = usage.ru_utime + usage.ru_stime
        self.peak_bytes = 1024 * usage.ru_maxrss


class Program:
    def __init__(self, path=common.PROGRAM):
        self.path = pathlib.Path(common.need(pathlib.Path(path), "run scripts/build first"))
        self._stamp = None

    def stamp(self):
        if self._stamp is None:
            self._stamp = hashlib.sha256(self.path.read_bytes()).hexdigest()[:16]
        return self._stamp

    def __call__(self, *arguments, accepted=(0, 4)):
        """Raises Failed for other exit codes than the accepted ones. Its progress is kept for that."""
        started = time.monotonic()
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as progress:
            child = subprocess.Popen([self.path, *map(str, arguments)], stdout=out, stderr=progress)
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            progress.seek(0)
            done = Done(child.returncode, out.read().decode(errors="replace"), usage, time.monotonic() - started)
            if done.code not in accepted:
                said = progress.read().decode(errors="replace").strip().splitlines()
                raise Failed(f"mapweave {arguments[0]} ended with exit code {done.code}: {said[-1] if said else 'it said nothing'}")
        return done
