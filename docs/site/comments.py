#!/usr/bin/env python3
"""Doxygen's input filter: the plain comments of a header as documentation.

    comments.py HEADER

A comment that stands alone goes with what follows it, one at the end of a line
with what stands before it; the first one is the header's own. Text that is
indented within a comment is code.
"""

import pathlib
import re
import sys

_ALONE = re.compile(r"^(\s*)//(.*)$")
_TRAILING = re.compile(r"^(.*?\S.*?)(\s+)//(.*)$")


def _text(comment: str) -> str:
    """Doxygen takes four more blanks for code."""
    return "     " + comment if comment.startswith("  ") else comment


def documented(lines: list[str]) -> list[str]:
    out = ["/** \\file"]
    at = 0
    while at < len(lines) and lines[at].startswith("//"):
        out.append(_text(lines[at][2:]))
        at += 1
    out[-1] += " */"
    column = -1  # of a comment at the end of the line before
    for line in lines[at:]:
        alone = _ALONE.match(line)
        trailing = None if alone else _TRAILING.match(line)
        if alone and len(alone[1]) == column:
            out.append(f"{alone[1]}///<{alone[2]}")
        elif alone:
            column = -1
            out.append(f"{alone[1]}///{_text(alone[2])}")
        elif trailing and "//" not in trailing[1]:
            column = len(trailing[1]) + len(trailing[2])
            out.append(f"{trailing[1]}{trailing[2]}///<{trailing[3]}")
        else:
            column = -1
            out.append(line)
    return out


if __name__ == "__main__":
    source = pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")
    print("\n".join(documented(source.splitlines())))
