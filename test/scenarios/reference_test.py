"""configs/reference.yaml is what the program says its defaults are."""
import support


class Reference(support.Scenario):
    def test_the_stored_reference_is_the_program_s_own(self):
        shown = self.mapweave("config", "reference").stdout
        stored = (support.ROOT / "configs/reference.yaml").read_text()
        self.assertEqual(stored, shown, "run: build/release/bin/mapweave config reference > configs/reference.yaml")

    def test_every_example_is_accepted_but_for_the_logs_it_lacks(self):
        for path in sorted((support.ROOT / "configs").glob("*.yaml")):
            if path.name == "reference.yaml":
                continue
            with self.subTest(path.name):
                done = self.mapweave("config", "check", path, code=(support.DONE, support.BAD_INPUT))
                self.assertNotIn("unknown key", done.stderr)


if __name__ == "__main__":
    support.main()
