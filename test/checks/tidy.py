#!/usr/bin/env python3
"""Runs clang-tidy on the sources of a build, several at a time.

    tidy.py BUILD_DIR --all
    tidy.py BUILD_DIR --base COMMIT     what differs from the commit
    tidy.py BUILD_DIR --files FILE...

The build must be configured, with its generated headers (selfcal_generated).
For a changed header, one source that includes it is checked. The checks are
those of .clang-tidy. Exit code 1 if there is a finding.

With --seconds no check begins later than that; what was left out is counted in
the last line.

A source without findings is remembered in CACHE, with the text of all headers
of the project that it includes, and is not checked again until one changes.
"""

import argparse
import concurrent.futures
import functools
import hashlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
CACHE = ROOT / "build/lint/tidy"
FOLDERS = ("core", "client", "migrations", "proto", "server", "test")
# What clang does not know, and warnings, which are those of g++.
_LEFT_OUT = re.compile(r"-m(move|store)-max=|-W")
_FINDING = re.compile(r"^\S+:\d+:\d+: (warning|error): ", re.MULTILINE)
_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
_NOISE = re.compile(r"^(\d+ warnings? .*generated|Suppressed \d+|Use -header)")


def compile_commands(build: pathlib.Path) -> dict:
    """The commands by source, relative to the project, as clang takes them."""
    commands = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        file = pathlib.Path(entry["file"])
        if not file.is_relative_to(ROOT) or file.is_relative_to(build):
            continue
        name = str(file.relative_to(ROOT))
        if name in commands or name.split("/")[0] not in FOLDERS:
            continue  # one vector width is enough
        arguments = shlex.split(entry["command"])
        names = [os.path.basename(argument) for argument in arguments]
        if "ccache" in names:
            del arguments[: names.index("ccache") + 1]
        commands[name] = {
            "directory": entry["directory"],
            "file": str(file),
            "arguments": [a for a in arguments if not _LEFT_OUT.match(a)],
        }
    return commands


def changed_files(base: str) -> list:
    """What differs from where this branch left the commit, new files, too."""
    fork = subprocess.run(
        ["git", "merge-base", base, "HEAD"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    listed = []
    for command in (
        ["diff", "--name-only", "--diff-filter=d", fork],
        ["ls-files", "--others", "--exclude-standard"],
    ):
        listed += subprocess.run(
            ["git", *command], cwd=ROOT, check=True,
            capture_output=True, text=True,
        ).stdout.splitlines()  # fmt: skip
    return listed


def sources_for(changed: list, commands: dict) -> list:
    """Changed sources, and for each changed header one that includes it."""
    chosen = {file for file in changed if file in commands}
    for header in changed:
        if not header.endswith(".h"):
            continue
        include = f'#include "{header}"'
        stem = header[:-2]
        # That of its own name is the one that has most to do with it.
        candidates = sorted(
            commands, key=lambda s: (s != f"{stem}.cc", s in chosen, s)
        )
        for source in candidates:
            if include in (ROOT / source).read_text(encoding="utf-8"):
                chosen.add(source)
                break
    return sorted(chosen)


class Cache:
    """The sources that were found without fault, by all that they contain."""

    def __init__(self, build: pathlib.Path) -> None:
        self._generated = build / "proto/generated"
        version = subprocess.run(
            ["clang-tidy", "--version"], check=True, capture_output=True
        ).stdout
        self._common = version + (ROOT / ".clang-tidy").read_bytes()
        CACHE.mkdir(parents=True, exist_ok=True)

    @functools.cache  # noqa: B019, there is one
    def _read(self, name: str) -> tuple:
        """The hash of a file, and the files of the project it includes."""
        for root in (ROOT, self._generated):
            path = root / name
            if path.is_file():
                text = path.read_text(encoding="utf-8")
                digest = hashlib.sha256(text.encode()).hexdigest()
                return digest, _INCLUDE.findall(text)
        return "", []

    def entry(self, command: dict) -> pathlib.Path:
        source = str(pathlib.Path(command["file"]).relative_to(ROOT))
        seen, waiting = {source}, [source]
        while waiting:
            included = set(self._read(waiting.pop())[1]) - seen
            seen |= included
            waiting += included
        key = hashlib.sha256(self._common)
        key.update(json.dumps(command["arguments"]).encode())
        for name in sorted(seen):
            key.update(f"{name} {self._read(name)[0]}\n".encode())
        return CACHE / key.hexdigest()


def check(source: str, database: str, end: float) -> tuple:
    """The findings as text, without the tool's remarks; None after the end."""
    if time.monotonic() > end:
        return source, None
    done = subprocess.run(
        ["clang-tidy", "--quiet", "-p", database,
         f"--header-filter=^{ROOT}/({'|'.join(FOLDERS)})/", source],
        cwd=ROOT, text=True, capture_output=True, check=False,
    )  # fmt: skip
    errors = [
        line
        for line in done.stderr.splitlines()
        if line.strip() and not _NOISE.match(line)
    ]
    text = done.stdout.replace(f"{ROOT}/", "")
    if done.returncode != 0 and not text.strip():
        text = "\n".join(errors) or f"{source}: clang-tidy failed"
    return source, text if done.returncode != 0 or text.strip() else ""


def separate(text: str) -> list:
    """Each finding, with the lines that belong to it."""
    begins = [match.start() for match in _FINDING.finditer(text)]
    if not begins:
        return [text.strip()] if text.strip() else []
    ends = [*begins[1:], len(text)]
    return [text[b:e].strip() for b, e in zip(begins, ends)]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("build", type=pathlib.Path)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--all", action="store_true")
    what.add_argument("--base")
    what.add_argument("--files", nargs="+")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    arguments = parser.parse_args()
    commands = compile_commands(arguments.build.resolve())
    if arguments.all:
        sources = sorted(commands)
    else:
        changed = arguments.files or changed_files(arguments.base)
        sources = sources_for(changed, commands)

    begin = time.monotonic()
    cache = Cache(arguments.build.resolve())
    entries = {source: cache.entry(commands[source]) for source in sources}
    waiting = [source for source in sources if not entries[source].exists()]
    end = begin + arguments.seconds
    findings, left_out = set(), 0
    with tempfile.TemporaryDirectory() as database:
        (pathlib.Path(database) / "compile_commands.json").write_text(
            json.dumps([commands[source] for source in waiting])
        )
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            jobs = [pool.submit(check, s, database, end) for s in waiting]
            for k, job in enumerate(
                concurrent.futures.as_completed(jobs), start=1
            ):
                source, text = job.result()
                if sys.stderr.isatty():
                    print(f"\r{k} of {len(waiting)} ", end="", file=sys.stderr)
                if text is None:
                    left_out += 1
                    continue
                if not text:
                    entries[source].touch()
                # A header is found through several sources: say it once.
                for finding in separate(text):
                    if finding not in findings:
                        findings.add(finding)
                        print(finding, flush=True)
    seconds = time.monotonic() - begin
    print(
        f"{len(sources)} of {len(commands)} sources, "
        f"{len(sources) - len(waiting)} of them checked before, "
        f"{left_out} left out, in {seconds:.0f} s; {len(findings)} findings"
    )
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
