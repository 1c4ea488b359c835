"""configs/reference.yaml is what the program says its defaults are, and texts of options are read alone."""
import re

import support

# Numbers that are no more or less of something.
NO_AMOUNTS = {"seed", "x_m", "y_m", "yaw_rad", "laser_x_m", "laser_y_m", "laser_yaw_rad", "sweep_stamp", "page_port", "cloud_ring"}

# A text that begins so goes on from the option before it, which nobody sees in a tooltip or in an error message.
GOES_ON = r"\A(?:and|or|nor|but|plus|also|else|otherwise|of|to|in|on|from|it|its|they|their|this|that|these|those|the same)\b"

# How a name ends, and the unit in words that its text has: the first line that fits.
UNITS = [
    ("_per_sqrt_m", "after 1 m"), ("_per_sqrt_rad", "by 1 rad"),
    ("_per_s2", "per second squared"), ("_per_s", "per second"), ("_mps", "metres per second"), ("_hz", "per second"), ("_per_second", "per second"),
    ("_m2", "square metre"), ("_m", "metre"), ("_ms", "millisecond"), ("_s", "second"), ("_deg", "degree"), ("_rad", "radian"), ("_px", "pixel"),
    ("_mb", "megabyte"), ("_kb", "kB")]


def options_of(reference):
    """Name, value and text of each option and section, those of list entries too."""
    text = ""
    for line in reference.splitlines():
        if in_list := re.fullmatch(r"\s*#\s+(?:# )?(?:- )?(\w+):(?: (\S.*?))?  # (.*)", line):
            yield in_list.groups()
        elif line.lstrip().startswith("#"):
            text = line.lstrip()[2:]
        elif option := re.fullmatch(r"\s*(\w+):(?: (.*))?", line):
            yield option.group(1), option.group(2), text


def numbers_of(reference):
    """Name and text of each option that is a number."""
    return [(name, text) for name, value, text in options_of(reference) if re.fullmatch(r"-?[\d.e+-]+", value or "")]


def unit_of(name):
    return next((unit for ending, unit in UNITS if name.endswith(ending)), "")


class Reference(support.Scenario):
    def test_the_stored_reference_is_the_program_s_own(self):
        shown = self.mapweave("config", "reference").stdout
        stored = (support.ROOT / "configs/reference.yaml").read_text()
        self.assertEqual(stored, shown, "run: build/release/bin/mapweave config reference > configs/reference.yaml")

    def test_every_number_says_what_a_larger_value_means(self):
        numbers = numbers_of(self.mapweave("config", "reference").stdout)
        self.assertGreater(len(numbers), 250)
        for name, text in numbers:
            with self.subTest(name, text=text):
                self.assertTrue(name in NO_AMOUNTS or re.search(r"\blarger \w+", text))

    def test_every_text_of_a_run_and_of_a_world_stands_alone(self):
        for of, least in (("run", 450), ("world", 160)):
            options = list(options_of(self.mapweave("config", "reference", "--of", of).stdout))
            self.assertGreater(len(options), least)
            for name, _, text in options:
                with self.subTest(name, of=of, text=text):
                    self.assertNotRegex(text, re.compile(GOES_ON, re.IGNORECASE))
                    self.assertGreaterEqual(len(text.split()), 3)
                    self.assertIn(unit_of(name), text)

    def test_every_example_is_accepted_but_for_the_logs_it_lacks(self):
        for path in sorted((support.ROOT / "configs").glob("*.yaml")):
            if path.name == "reference.yaml":
                continue
            with self.subTest(path.name):
                done = self.mapweave("config", "check", path, code=(support.DONE, support.BAD_INPUT))
                self.assertNotIn("unknown key", done.stderr)


if __name__ == "__main__":
    support.main()
