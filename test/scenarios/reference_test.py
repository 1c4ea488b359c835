"""configs/reference.yaml is what the program says its defaults are."""
import re

import support

# Numbers that are no more or less of something.
NO_AMOUNTS = {"seed", "x_m", "y_m", "yaw_rad", "laser_x_m", "laser_y_m", "laser_yaw_rad", "sweep_stamp", "page_port", "cloud_ring"}


def numbers_of(reference):
    """Name and text of each option that is a number."""
    text = ""
    for line in reference.splitlines():
        if in_list := re.fullmatch(r"\s*#\s+(?:# )?(?:- )?(\w+): -?[\d.e+-]+  # (.*)", line):
            yield in_list.group(1), in_list.group(2)
        elif line.lstrip().startswith("#"):
            text = line
        elif number := re.fullmatch(r"\s*(\w+): -?[\d.e+-]+", line):
            yield number.group(1), text


class Reference(support.Scenario):
    def test_the_stored_reference_is_the_program_s_own(self):
        shown = self.mapweave("config", "reference").stdout
        stored = (support.ROOT / "configs/reference.yaml").read_text()
        self.assertEqual(stored, shown, "run: build/release/bin/mapweave config reference > configs/reference.yaml")

    def test_every_number_says_what_a_larger_value_means(self):
        numbers = list(numbers_of(self.mapweave("config", "reference").stdout))
        self.assertGreater(len(numbers), 250)
        for name, text in numbers:
            with self.subTest(name, text=text):
                self.assertTrue(name in NO_AMOUNTS or re.search(r"\blarger \w+", text))

    def test_every_example_is_accepted_but_for_the_logs_it_lacks(self):
        for path in sorted((support.ROOT / "configs").glob("*.yaml")):
            if path.name == "reference.yaml":
                continue
            with self.subTest(path.name):
                done = self.mapweave("config", "check", path, code=(support.DONE, support.BAD_INPUT))
                self.assertNotIn("unknown key", done.stderr)


if __name__ == "__main__":
    support.main()
