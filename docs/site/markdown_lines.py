"""Markdown: what is code in it, and text that is to stay as it is."""

import re

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>|#$])")


def prose_lines(text: str) -> list[tuple[bool, str]]:
    """Each line, and whether it is outside of blocks of code."""
    out, fence = [], None
    for line in text.splitlines():
        mark = re.match(r"\s*(```+)", line)
        if mark and fence is None:
            fence = mark[1]
            out.append((False, line))
        elif mark and line.strip() == fence:
            fence = None
            out.append((False, line))
        else:
            out.append((fence is None, line))
    return out


def escaped(text: str) -> str:
    """`code` stays code; all else is as it stands."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        part if i % 2 else _SPECIAL.sub(r"\\\1", part)
        for i, part in enumerate(parts)
    )
