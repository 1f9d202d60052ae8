#!/usr/bin/env python3
"""Runs a tutorial: every command of it, from top to bottom, in one shell.

    tutorial_test.py TUTORIAL ROOT BUILD [RECORDINGS]

Blocks of code are taken in their order. `sh` is run, from ROOT and with a home
of its own; `<!-- file: NAME -->` before a block of any kind makes it a file;
`<!-- not run: WHY -->` leaves one out, and `<!-- needs recordings -->` does
where there are none. A block of `text` is what the commands before it must
print; `...` in it stands for anything. All other blocks are an error.

The build is BUILD instead of build/dev, ports are free ones, and RECORDINGS (or
SELFCAL_TEST_DATA) is in the environment.
"""

import contextlib
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile

PORTS = ("7447", "7448", "9464")
TIMEOUT_S = 840  # CTest has a limit for each tutorial


def blocks(text: str):
    """(note, language, code) of each block; the note stands right before."""
    for match in re.finditer(
        r"(?:<!-- ([^>]*) -->\n)?^```(\w+)\n(.*?)^```$", text, re.M | re.S
    ):
        yield match[1] or "", match[2], match[3]


def free_port() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


class Tutorial:
    def __init__(self, text: str, build: str, recordings: str) -> None:
        text = re.sub(r"(\$PWD/)?\bbuild/dev\b", build, text)
        for port in PORTS:
            text = re.sub(rf"\b{port}\b", free_port(), text)
        self.script = ""
        self.commands: list[str] = []
        self.expected: dict[int, str] = {}
        skipped = False
        for note, language, code in blocks(text):
            if note.startswith("file: "):
                self.script += f"cat >{note[6:]} <<'=====END'\n{code}=====END\n"
            elif language == "text":
                if not skipped:
                    self.expected[len(self.commands) - 1] = code
            elif language != "sh":
                raise ValueError(f"a block of {language} that is not tested")
            else:
                skipped = note.startswith("not run: ") or (
                    note == "needs recordings" and not recordings
                )
                if not skipped and "ctest --test-dir" not in code:
                    self.script += f"echo @@{len(self.commands)}\n{code}"
                    self.commands.append(code)

    def outputs(self, printed: str) -> dict[int, str]:
        parts = re.split(r"^@@(\d+)\n", printed, flags=re.M)[1:]
        return {int(n): out for n, out in zip(parts[::2], parts[1::2])}


def matches(expected: str, printed: str) -> bool:
    pattern = re.escape(expected.strip()).replace(re.escape("..."), ".*")
    pattern = re.sub(r"(\\ )+", r"[ \\t]+", pattern)
    # An empty last column leaves a tab.
    printed = re.sub(r"[ \t]+$", "", printed, flags=re.M)
    return bool(re.fullmatch(pattern, printed.strip(), re.S))


def run(tutorial: Tutorial, root: str, home: str, recordings: str):
    environment = {
        **os.environ, "HOME": home, "RECORDINGS": recordings,
    }  # fmt: skip
    # A file, not a pipe: what a tutorial leaves running would hold that.
    with open(f"{home}/printed", "w+", encoding="utf-8") as printed:
        process = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", tutorial.script],
            cwd=root,
            env=environment,
            stdout=printed,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            code = process.wait(TIMEOUT_S)
        finally:
            # There is no such process if nothing was left running.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        printed.seek(0)
        return code, printed.read()


def main() -> int:
    path, root, build, recordings = (sys.argv[1:] + [""])[:4]
    recordings = os.environ.get("SELFCAL_TEST_DATA", recordings)
    if not os.path.isdir(recordings):
        recordings = ""
    text = pathlib.Path(path).read_text(encoding="utf-8")
    tutorial = Tutorial(text, build, recordings)
    with tempfile.TemporaryDirectory() as home:
        code, printed = run(tutorial, root, home, recordings)
    print(printed)
    if code != 0:
        print(f"FAILED: the last command printed ended with {code}")
        return 1
    outputs = tutorial.outputs(printed)
    failed = False
    for number, expected in tutorial.expected.items():
        if not matches(expected, outputs.get(number, "")):
            print(
                f"FAILED: after\n{tutorial.commands[number]}\nthe tutorial "
                f"has\n{expected}\nand this was printed:\n"
                f"{outputs.get(number, '')}"
            )
            failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
