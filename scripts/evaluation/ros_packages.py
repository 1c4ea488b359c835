#!/usr/bin/env python3
"""Makes an environment below build/ with PyPI's rosbags and mcap, where it is missing, and prints its interpreter."""
import fcntl
import pathlib
import subprocess
import sys

PACKAGES = ("rosbags==0.11.9", "mcap==1.6.0")
ENVIRONMENT = pathlib.Path(__file__).resolve().parents[2] / "build/ros_readers"


class Missing(Exception):
    """The packages are not there, or cannot be installed."""


def installed():
    """The interpreter of the environment."""
    python = ENVIRONMENT / "bin/python"
    try:
        if subprocess.run([python, "-c", "import rosbags, mcap"], capture_output=True, check=False).returncode == 0:
            return python
    except OSError:
        pass
    raise Missing(f"{', '.join(PACKAGES)} are not installed in {ENVIRONMENT}")


def interpreter():
    """As installed(), and makes the environment where it is missing. Tests that run beside each other wait here."""
    ENVIRONMENT.parent.mkdir(parents=True, exist_ok=True)
    with ENVIRONMENT.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            return installed()
        except Missing:
            install()
        return installed()


def install():
    python = ENVIRONMENT / "bin/python"
    for command in ([sys.executable, "-m", "venv", "--clear", ENVIRONMENT], [python, "-m", "pip", "install", "--quiet", *PACKAGES]):
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise Missing(f"{', '.join(PACKAGES)} cannot be installed: {error}") from None
        if done.returncode != 0:
            last = (done.stderr or done.stdout).strip().splitlines()[-1:]
            raise Missing(f"{', '.join(PACKAGES)} cannot be installed: {' '.join(last)}")


if __name__ == "__main__":
    try:
        print(interpreter())
    except Missing as problem:
        sys.exit(f"{sys.argv[0]}: {problem}")
