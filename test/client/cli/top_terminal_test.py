"""selfcal top on a terminal, against a real daemon.

top_terminal_test.py SELFCAL SELFCALD
"""

import fcntl
import json
import os
import pathlib
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest

SELFCAL, SELFCALD = sys.argv[1:3]
sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

from device import RIG
from running_daemon import PATIENCE_S, RunningDaemon

ENTER, LEAVE, HOME = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l", "\x1b[H"


class Terminal:
    """A command with a terminal of its own."""

    def __init__(self, command: list, columns: int, rows: int) -> None:
        self.text = ""
        self.pid, self.end = pty.fork()
        if self.pid == 0:
            os.execv(command[0], command)
        self.resize(columns, rows)

    def resize(self, columns: int, rows: int) -> None:
        size = struct.pack("HHHH", rows, columns, 0, 0)
        fcntl.ioctl(self.end, termios.TIOCSWINSZ, size)

    def read_until(self, found, seconds: float = 20) -> None:
        limit = time.monotonic() + seconds
        while not found(self.text):
            if time.monotonic() > limit:
                raise AssertionError(f"not in time: {self.text!r}")
            if select.select([self.end], [], [], 0.2)[0]:
                try:
                    self.text += os.read(self.end, 65536).decode()
                except OSError:  # it has ended
                    if not found(self.text):
                        raise AssertionError(f"ended: {self.text!r}") from None

    def wait(self) -> int:
        limit = time.monotonic() + PATIENCE_S
        while True:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            if ended:
                return os.waitstatus_to_exitcode(status)
            if time.monotonic() > limit:
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)
                raise AssertionError(f"does not end: {self.text!r}")
            time.sleep(0.01)


def screens(text: str) -> list:
    """The lines of each whole drawing, without what a terminal obeys."""
    return [
        re.sub(r"\x1b\[[?0-9]*[A-Za-z]", "", part).replace("\r", "").split("\n")
        for part in text.split(HOME)[1:]
        if part.endswith("\x1b[J") or LEAVE in part
    ]


class TopTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.running = RunningDaemon(SELFCALD, f"{folder.name}/state")
        self.addCleanup(self.running.stop)
        self.target = self.running.target
        for i in range(12):
            path = f"{folder.name}/rig.json"
            with open(path, "w", encoding="utf-8") as file:
                json.dump({"name": f"rigs/phone-{i:02}", **RIG}, file)
            self.assertEqual(self.selfcal("rig", "create", path).returncode, 0)

    def selfcal(self, *arguments) -> subprocess.CompletedProcess:
        return subprocess.run(
            [SELFCAL, "--target", self.target, *arguments],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )

    def top(self, *arguments) -> Terminal:
        command = [SELFCAL, "--target", self.target, "top", *arguments]
        return Terminal(command, 60, 8)

    def test_draws_again_in_its_size_until_it_is_interrupted(self) -> None:
        top = self.top("--interval", "0.1")
        top.read_until(lambda text: text.count(HOME) > 3)
        self.assertTrue(top.text.startswith(ENTER))
        for lines in screens(top.text)[1:]:  # the size was set meanwhile
            self.assertLessEqual(len(lines), 8)
            self.assertLessEqual(max(map(len, lines)), 60)
        last = screens(top.text)[-1]
        self.assertIn("streams 0", last[0])
        # The phones that there is room for; none has sent anything.
        self.assertEqual(sum("phone-" in line for line in last), 5)
        os.kill(top.pid, signal.SIGINT)
        top.read_until(lambda text: text.endswith(LEAVE))
        self.assertEqual(top.wait(), 0)

    def test_draws_at_once_when_the_terminal_grows(self) -> None:
        top = self.top("--interval", "3600")
        top.read_until(lambda text: "\x1b[J" in text)
        before = len(screens(top.text))
        top.resize(100, 30)
        top.read_until(lambda text: len(screens(text)) > before)
        top.read_until(
            lambda text: (
                sum("phone-" in line for line in screens(text)[-1]) == 12
            )
        )
        os.kill(top.pid, signal.SIGTERM)
        self.assertEqual(top.wait(), 0)

    def test_leaves_the_terminal_as_it_was_when_the_daemon_goes(self) -> None:
        top = self.top("--interval", "0.1")
        top.read_until(lambda text: "\x1b[J" in text)
        self.running.stop()
        top.read_until(lambda text: "selfcal: " in text.split(LEAVE)[-1])
        self.assertEqual(top.text.count(LEAVE), 1)
        self.assertEqual(top.wait(), 3, top.text.split(LEAVE)[-1])

    def test_once_is_a_table_and_no_screen(self) -> None:
        top = self.top("--once", "--color", "never", "--rigs", "3")
        top.read_until(lambda text: text.count("phone-") == 3)
        self.assertEqual(top.wait(), 0)
        self.assertNotIn("\x1b", top.text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
