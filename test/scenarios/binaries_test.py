"""What the binaries of ours load: no graphics, and MRPT's SLAM library in the helper alone.

usage: binaries_test.py FOLDER PROGRAM...    FOLDER: where the build puts binaries; PROGRAM: those of apps/
"""
import pathlib
import re
import subprocess
import sys
import unittest

import support

FOLDER, PROGRAMS = None, []
GRAPHICS = re.compile(r"^lib(vtk|Qt\d|opencv_highgui|opencv_viz|GL|GLU|GLX|OpenGL|EGL|X11|Xext|glut|glfw|mrpt-gui|pcl_visualization|pcl_io)\b", re.IGNORECASE)


def needed(binary):
    listing = subprocess.run(["readelf", "-d", binary], capture_output=True, text=True, check=True, env=support.environment()).stdout
    return re.findall(r"\(NEEDED\).*\[(.*)\]", listing)


class Binaries(unittest.TestCase):
    def setUp(self):
        self.binaries = [path for path in sorted(FOLDER.iterdir()) if path.is_file() and path.open("rb").read(4) == b"\x7fELF"]

    def test_every_program_is_there(self):
        names = {path.name for path in self.binaries}
        self.assertLessEqual({"mapweave", *PROGRAMS}, names)

    def test_the_list_is_read_at_all(self):
        for path in self.binaries:
            self.assertTrue(any(name.startswith("libc.so") for name in needed(path)), path)

    def test_no_graphics_are_needed(self):
        found = {path.name: bad for path in self.binaries if (bad := [name for name in needed(path) if GRAPHICS.match(name)])}
        self.assertEqual(found, {})

    def test_the_slam_library_of_mrpt_is_in_its_helper_alone(self):
        users = {path.name for path in self.binaries if any(name.startswith("libmrpt-slam") for name in needed(path))}
        self.assertEqual(users, {"mrpt_mapper"})


if __name__ == "__main__":
    FOLDER, PROGRAMS = pathlib.Path(sys.argv[1]), sys.argv[2:]
    sys.argv = sys.argv[:1]
    support.main()
