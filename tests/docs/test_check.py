"""The check of the documentation notices what it is there for: `python3 -m unittest discover tests/docs`."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check  # noqa: E402


class Faults(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for name in ("docs", "site", "src"):
            (self.root / name).mkdir()
        (self.root / "site/docs").symlink_to("../docs")
        self.write("site/SUMMARY.md", "- [A](docs/a.md)\n- [B](docs/b.md)\n")
        self.write("docs/b.md", "# B\n\n## Two words\n\n## Two words\n")

    def write(self, name, text):
        (self.root / name).write_text(text, encoding="utf-8")

    def found(self, text):
        self.write("docs/a.md", text)
        return [what for _, _, what in check.faults(self.root)]

    def test_good_links_are_none(self):
        self.assertEqual(self.found("[b](b.md) [two](b.md#two-words-1) [web](https://example.org) `src/`"), [])

    def test_a_link_to_nothing(self):
        self.assertIn("leads to no file", self.found("[c](c.md)")[0])
        self.assertIn("leads to no file", self.found("[out](../../x.md)")[0])

    def test_a_heading_that_is_not_there(self):
        self.assertIn("no heading #three", self.found("[b](b.md#three)")[0])

    def test_a_link_out_of_the_site(self):
        self.assertIn("the site lacks", self.found("[src](../src)")[0])

    def test_links_in_code_are_none(self):
        self.assertEqual(self.found("`[c](c.md)`\n```\n[c](c.md)\n```\n"), [])

    def test_a_path_that_is_not_there(self):
        self.assertEqual(self.found("`src/gone.rs`"), ["there is no src/gone.rs"])

    def test_a_page_that_the_contents_lack(self):
        self.write("docs/c.md", "# C\n")
        self.assertEqual(self.found("# A"), ["lacks docs/c.md"])

    def test_commands_options_and_keys(self):
        self.write("docs/a.md", "`paws twin REC --out T --loud`, `paws fly`, `hands.gone`, `hands.min_samples`\n")
        page = check.Page("docs/a.md", self.root)
        known = {"twin": "--out <DIR>  Folder\n--louder  More"}
        commands = [what for _, _, what in check.command_faults(page, known)]
        self.assertEqual(commands, ["paws twin has no option --loud", "paws has no command fly"])
        keys = [what for _, _, what in check.key_faults(page, {"hands.min_samples"})]
        self.assertEqual(keys, ["paws config has no hands.gone"])


if __name__ == "__main__":
    unittest.main()
