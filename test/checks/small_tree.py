"""The test of a check that runs on small trees of files."""

import pathlib
import subprocess
import sys
import tempfile
import unittest


class SmallTreeTest(unittest.TestCase):
    CHECK: pathlib.Path  # the program
    TREE: dict[str, str]  # name to text: passes

    def run_check(self, root: pathlib.Path) -> tuple:
        """The exit code and the lines that the check prints of a tree."""
        done = subprocess.run(
            [sys.executable, self.CHECK, root],
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(done.stderr, "")
        return done.returncode, done.stdout.splitlines()

    def check(self, changes: dict) -> tuple:
        """The same of the tree with these files changed."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            subprocess.run(["git", "init", "-q", folder], check=True)
            for name, text in {**self.TREE, **changes}.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)
            return self.run_check(root)

    def expect_one(self, changes: dict, *words: str) -> None:
        """One finding, with these words."""
        code, lines = self.check(changes)
        self.assertEqual(code, 1)
        self.assertEqual(len(lines), 1, lines)
        for word in words:
            self.assertIn(word, lines[0])
