#!/usr/bin/env python3
"""Writes the changelog of a Debian package from CHANGELOG.md.

    debian_changelog.py CHANGELOG.md PACKAGE VERSION MAINTAINER OUT.gz

An entry for each version, the newest first. A section `## 1.2.0 - 2026-11-24`
has its date; `## Unreleased` is VERSION, with the date of the last commit to
the file, or of the file itself where there is no git. Every list item becomes
one of the entry, behind the subsection that it is in.
"""

import datetime
import email.utils
import gzip
import pathlib
import re
import subprocess
import sys
import textwrap

_SECTION = re.compile(
    r"^## (?:\[?(\d[\d.]*)\]? - (\d{4}-\d\d-\d\d)|Unreleased)"
)
_LINK = re.compile(r"\[([^]]*)\]\([^)]*\)")


def sections(text: str):
    """Yields (version or None, date or None, items) of each section."""
    version, date, items, heading, inside = None, None, [], "", False
    for line in text.splitlines():
        if match := _SECTION.match(line):
            if inside:
                yield version, date, items
            version, date = match.groups()
            items, heading, inside = [], "", True
        elif line.startswith("### "):
            heading = line[4:].strip()
        elif inside and line.startswith("- "):
            items.append(f"{heading}: {line[2:]}" if heading else line[2:])
        elif inside and line.startswith("  ") and items:
            items[-1] += " " + line.strip()
    if inside:
        yield version, date, items


def last_change(path: pathlib.Path) -> float:
    command = ["git", "-c", "safe.directory=*", "-C", str(path.parent),
               "log", "-1", "--format=%ct", "--", path.name]  # fmt: skip
    try:
        shown = subprocess.run(
            command, check=True, capture_output=True, text=True
        ).stdout
        return float(shown)
    except (OSError, ValueError, subprocess.CalledProcessError):
        return path.stat().st_mtime


def entry(
    package: str, version: str, released: bool, when: float, items: list,
    maintainer: str,
) -> str:  # fmt: skip
    suite = "bookworm" if released else "UNRELEASED"
    lines = [f"{package} ({version}-1) {suite}; urgency=medium", ""]
    for item in items:
        text = _LINK.sub(r"\1", item).replace("`", "")
        lines += textwrap.wrap(
            text, 78, initial_indent="  * ", subsequent_indent="    ",
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
    stamp = email.utils.formatdate(when)
    return "\n".join([*lines, "", f" -- {maintainer}  {stamp}", ""])


def main() -> None:
    source, package, current, maintainer, out = sys.argv[1:]
    path = pathlib.Path(source).resolve()
    entries = []
    for version, date, items in sections(path.read_text(encoding="utf-8")):
        if not items:
            continue  # nothing is unreleased
        when = last_change(path)
        if date:
            day = datetime.date.fromisoformat(date)
            noon = datetime.time(12, tzinfo=datetime.timezone.utc)
            when = datetime.datetime.combine(day, noon).timestamp()
        entries.append(
            entry(
                package,
                version or current,
                version is not None,
                when,
                items,
                maintainer,
            )
        )
    if not entries:
        sys.exit(f"{source}: has no section with items")
    with open(out, "wb") as file:
        # Without name and time, so that the same text gives the same file.
        file.write(gzip.compress("\n".join(entries).encode(), 9, mtime=0))


if __name__ == "__main__":
    main()
