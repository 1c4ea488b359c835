"""Folders of pictures: convert, split, inspect and run take them; what is wrong with them is named, and nothing half-written is left."""
import struct
import zlib

import support
from support import BAD_INPUT


def png(width, height, bits, value):
    """A grey PNG of one value, with a corner that differs."""
    pixel = struct.pack(">H" if bits == 16 else ">B", value)
    rows = b"".join(b"\0" + pixel * (width - 1) + (pixel if row else b"\1" * len(pixel)) for row in range(height))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    head = struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class CameraFolder(support.Scenario):
    def setUp(self):
        super().setUp()
        colour, depth = [], []
        for i in range(8):
            first, second = f"{50 + 0.1 * i:.6f}", f"{50.004 + 0.1 * i:.6f}"
            self.write_bytes(f"walk/rgb/{first}.png", png(80, 64, 8, 20 + i))
            self.write_bytes(f"walk/depth/{second}.png", png(80, 64, 16, 5000 + i))
            colour.append(f"{first} rgb/{first}.png\n")
            depth.append(f"{second} depth/{second}.png\n")
        self.write("walk/rgb.txt", "# color\n" + "".join(colour))
        self.write("walk/depth.txt", "# depth\n" + "".join(depth))
        self.write("walk/camera.yaml", "width: 80\nheight: 64\nfx: 80\nfy: 80\ncx: 40\ncy: 32\ndistortion: [0, 0, 0, 0, 0]\ndepth_scale: 5000\n")

    def write_bytes(self, name, data):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    def refuse(self, *words, verbs=("inspect", "convert", "split", "slam")):
        commands = {"inspect": ("inspect", "walk"), "convert": ("convert", "walk", "out.rawlog"),
                    "split": ("split", "walk", "--robots", "2", "--out", "parts"), "slam": ("slam", "walk", "--out", "out")}
        for verb in verbs:
            with self.subTest(verb):
                self.assert_says(self.mapweave(*commands[verb], code=BAD_INPUT), *words)
                self.assert_nothing_left("out", "out.rawlog", "parts")

    def test_inspect_says_the_same_of_a_folder_and_of_its_rawlog(self):
        self.mapweave("convert", "walk/", "walk.rawlog")
        for recording in ("walk", "walk/", "walk.rawlog"):
            done = self.mapweave("inspect", recording)
            for line in ("width: 80", "calibrated: true", "farthest_m: 1.0", "rate_hz: 9.99999", "most_depth_delay_s: 0.004"):
                self.assertIn(line, done.stdout)

    def test_parts_of_a_folder_are_folders_that_run_can_name(self):
        self.mapweave("split", "walk", "--robots", "2", "--overlap", "0.1", "--out", "parts")
        self.assertEqual(len(list((self.folder / "parts/robot0/rgb").iterdir())), 5)
        self.assertIn("log: robot1", (self.folder / "parts/run.yaml").read_text())
        self.assertIn("TUM", self.mapweave("inspect", "parts/robot1").stdout)
        self.assert_says(self.mapweave("run", "parts/run.yaml", "--out", "out", code=BAD_INPUT), "could be placed", "corners")
        self.assert_nothing_left("out")

    def test_pictures_that_show_nothing_are_refused_by_slam_with_the_reason(self):
        self.refuse("walk", "none of the 8 frames", "could be placed", verbs=("slam",))

    def test_a_laser_is_asked_for_in_vain(self):
        done = self.mapweave("slam", "walk", "--sensor", "laser", "--out", "out", code=BAD_INPUT)
        self.assert_says(done, "laser", "walk")
        self.assert_nothing_left("out")

    def test_parts_at_a_time_outside_are_refused(self):
        done = self.mapweave("split", "walk", "--robots", "2", "--at", "99", "--out", "parts", code=BAD_INPUT)
        self.assert_says(done, "walk", "outside", "50.000 to 50.700")
        self.assert_nothing_left("parts")

    def test_a_missing_calibration_is_asked_for_with_its_keys(self):
        (self.folder / "walk/camera.yaml").unlink()
        self.refuse("walk/camera.yaml", "fx", "depth_scale")

    def test_a_missing_depth_scale_is_asked_for(self):
        path = self.folder / "walk/camera.yaml"
        path.write_text(path.read_text().replace("depth_scale: 5000\n", ""))
        self.refuse("walk/camera.yaml", "depth_scale")

    def test_a_missing_picture_is_named(self):
        (self.folder / "walk/rgb/50.300000.png").unlink()
        self.refuse("rgb/50.300000.png")

    def test_a_picture_cut_short_is_named(self):
        path = self.folder / "walk/rgb/50.300000.png"
        path.write_bytes(path.read_bytes()[:60])
        self.refuse("rgb/50.300000.png", "cut short", verbs=("inspect", "convert", "slam"))

    def test_a_picture_of_another_size_is_named(self):
        self.write_bytes("walk/rgb/50.300000.png", png(40, 64, 8, 3))
        self.refuse("rgb/50.300000.png", "40 x 64", "80 x 64", "camera.yaml", verbs=("inspect", "convert", "slam"))

    def test_depth_of_8_bits_is_refused(self):
        self.write_bytes("walk/depth/50.304000.png", png(80, 64, 8, 3))
        self.refuse("depth/50.304000.png", "16 bits", verbs=("inspect", "convert", "slam"))

    def test_stamps_that_never_pair_are_refused(self):
        path = self.folder / "walk/depth.txt"
        path.write_text(path.read_text().replace("\n5", "\n15"))
        self.refuse("walk", "no colour and depth pictures", "max_pair_s")

    def test_stamps_that_run_backwards_are_named_with_their_line(self):
        path = self.folder / "walk/rgb.txt"
        path.write_text(path.read_text().replace("\n50.500000", "\n50.100000"))
        self.refuse("walk/rgb.txt:7", "backwards")

    def test_a_folder_of_no_layout_is_refused(self):
        for name in ("rgb.txt", "depth.txt"):
            (self.folder / "walk" / name).unlink()
        self.refuse("walk", "TUM", "KITTI", "EuRoC")


if __name__ == "__main__":
    support.main()
