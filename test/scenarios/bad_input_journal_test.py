"""Journals of live camera map servers that are damaged, empty or not what they seem: merge, export and inspect name the file and why, exit code 3."""
import sqlite3

import support
from support import BAD_INPUT

APPLICATION = 0x4D57444A
TABLE = ("CREATE TABLE updates (number INTEGER PRIMARY KEY, robot TEXT NOT NULL, sensor TEXT NOT NULL, run INTEGER NOT NULL, "
         "bytes INTEGER NOT NULL, sha256 BLOB NOT NULL, zstd BLOB NOT NULL) STRICT")


class BadJournal(support.Scenario):
    def refuse(self, *words):
        before = sorted(self.folder.iterdir())
        for verb in (("merge", "edge.mwj", "--out", "out"), ("export", "edge.mwj", "--out", "out"), ("inspect", "edge.mwj")):
            with self.subTest(verb[0]):
                self.assert_says(self.mapweave(*verb, code=BAD_INPUT), "edge.mwj", *words)
                self.assertEqual(sorted(self.folder.iterdir()), before)

    def journal(self, *rows, application=APPLICATION, schema=1, table=TABLE):
        path = self.folder / "edge.mwj"
        path.unlink(missing_ok=True)
        database = sqlite3.connect(path)
        database.execute(f"PRAGMA application_id = {application}")
        database.execute(f"PRAGMA user_version = {schema}")
        database.execute(table)
        database.executemany("INSERT INTO updates VALUES (NULL, ?, ?, ?, ?, ?, ?)", rows)
        database.commit()
        database.close()
        return path

    def test_one_to_which_nobody_published_anything(self):
        self.journal()
        self.refuse("no map in it")

    def test_what_is_no_journal(self):
        self.write("edge.mwj", "")
        self.refuse("empty")
        self.write("edge.mwj", "nothing " * 100)
        self.refuse("no sqlite file")
        self.journal(application=7)
        self.refuse("another program")
        self.journal(table=TABLE.replace("robot", "robots"))
        self.refuse("tables")
        self.journal(schema=9)
        self.refuse("schema 9")
        (self.folder / "edge.mwj").unlink()
        self.assert_says(self.mapweave("merge", "edge.mwj", "--out", "out", code=BAD_INPUT), "edge.mwj", "check the path")

    def test_a_damaged_update(self):
        self.journal(("alpha", "front", 7, 100, b"\0" * 32, b"no zstd"))
        self.refuse("update 1")
        self.journal(("../alpha", "front", 7, 100, b"\0" * 32, b"no zstd"))
        self.refuse("no valid name")

    def test_one_cut_short(self):
        path = self.journal(("alpha", "front", 7, 100, b"\0" * 32, b"x" * 20000))
        path.write_bytes(path.read_bytes()[:9000])
        self.refuse("cut short")

    def test_one_that_is_open(self):
        database = sqlite3.connect(self.journal(), isolation_level=None)
        self.addCleanup(database.close)
        database.execute("BEGIN EXCLUSIVE")
        self.assert_says(self.mapweave("inspect", "edge.mwj", code=BAD_INPUT), "edge.mwj", "open")


if __name__ == "__main__":
    support.main()
