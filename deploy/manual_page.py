#!/usr/bin/env python3
"""Writes the manual page of a program from its own --help.

    manual_page.py NAME SECTION VERSION OUT.gz COMMAND...

COMMAND starts the program (in an emulator, where that is needed). Its commands,
and theirs in turn, get a section each. The text is that of the program: what
is missing in the page is missing in --help.
"""

import gzip
import re
import subprocess
import sys

_HEADING = re.compile(r"^(Options|Positionals|Subcommands):$")
_COLUMN = 30  # where descriptions begin
_ENTRY = re.compile(r"^  (\S.*)$")
_MORE = re.compile(rf"^ {{{_COLUMN}}}(\S.*)$")
_VALUES = re.compile(r"(?:ENUM|BOOLEAN):value in \{([^}]*)\} OR \{[^}]*\}")


def help_of(command: list, path: list) -> list:
    """The lines of --help, with the options of groups as all others."""
    text = subprocess.run(
        [*command, *path, "--help"], check=True, capture_output=True, text=True
    ).stdout
    lines, in_group = [], False
    for line in text.splitlines():
        if line.startswith("[Option Group"):
            in_group = True
        elif in_group and line.startswith("  "):
            # "  [Exactly 1 of the following options is required]"
            if line.strip() and not line.startswith("  ["):
                lines.append(line[2:])
        else:
            in_group = False
            lines.append(line)
    return lines


def split(line: str, next_line: str) -> list:
    """Term and text of an entry; a long term has its text on the next line."""
    line = line.rstrip()
    if len(line) > _COLUMN and not _MORE.match(next_line):
        term, text = line[:_COLUMN].strip(), line[_COLUMN:]
    else:
        term, text = line.strip(), ""
    # "{read->0,produce->1} OR {0,1}" is how the program keeps these names.
    term = _VALUES.sub(
        lambda m: "|".join(v.split("->")[0] for v in m[1].split(",")), term
    )
    term = re.sub(r"\b([A-Z]+):\1 in ", r"\1 in ", term)
    # A line can be broken after the names of a list.
    term = re.sub(r"\{[^}]*\}", lambda m: m[0].replace(",", ", "), term)
    return [term, text]


def parse(lines: list) -> dict:
    """Description, usage, entries by heading as [term, text], and the rest."""
    found = {"description": "", "usage": "", "rest": []}
    heading = None
    for line, next_line in zip(lines, [*lines[1:], ""]):
        if line.startswith("Usage: "):
            # Without the words of the command itself.
            found["usage"] = line[max(line.find("["), 0) :]
        elif _HEADING.match(line):
            heading = line[:-1]
            found.setdefault(heading, [])
        elif heading and (more := _MORE.match(line)) and found[heading]:
            entry = found[heading][-1]
            entry[1] = f"{entry[1]} {more[1]}".strip()
        elif heading and _ENTRY.match(line):
            found[heading].append(split(line, next_line))
        elif not found["usage"]:
            found["description"] += line + " "
        elif heading:
            found["rest"].append(line)
    return found


def escaped(text: str) -> str:
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def entries(found: dict, heading: str) -> list:
    out = []
    for term, text in found.get(heading, []):
        out += [".TP", f".B {escaped(term)}"]
        out.append(escaped(text) if text else "\\&")
    return out


def command_sections(command: list, name: str, path: list) -> list:
    found = parse(help_of(command, path))
    out = []
    if path:
        title = " ".join([name, *path])
        out += [f".SS {escaped(title)} {escaped(found['usage'])}"]
        out += [escaped(found["description"].strip())]
        for heading in ("Positionals", "Options"):
            mine = [e for e in found.get(heading, []) if "--help" not in e[0]]
            out += entries({heading: mine}, heading)
    for term, _ in found.get("Subcommands", []):
        out += command_sections(command, name, [*path, term.split()[0]])
    return out


def page(name: str, section: str, version: str, command: list) -> str:
    top = parse(help_of(command, []))
    description = top["description"].strip().rstrip(".")
    summary = re.sub(f"^{re.escape(name)} ", "", description)
    out = [
        f'.TH {name.upper()} {section} "" "{name} {version}"',
        ".SH NAME",
        f"{name} \\- {escaped(summary)}",
        ".SH SYNOPSIS",
        f".B {name}",
        escaped(top["usage"]),
        ".SH OPTIONS",
        *entries(top, "Options"),
    ]
    if "Subcommands" in top:
        out += [".SH COMMANDS", *command_sections(command, name, [])]
    rest = "\n".join(top["rest"]).strip()
    if rest:
        out.append(".SH NOTES")
        for paragraph in rest.split("\n\n"):
            out += [".PP", escaped(" ".join(paragraph.split()))]
    other = "selfcald" if name == "selfcal" else "selfcal"
    out += [
        ".SH SEE ALSO",
        f".BR {other} ({'8' if other == 'selfcald' else '1'})",
    ]
    return "\n".join(out) + "\n"


def main() -> None:
    name, section, version, out, *command = sys.argv[1:]
    text = page(name, section, version, command)
    with open(out, "wb") as file:
        # Without name and time, so that the same program gives the same page.
        file.write(gzip.compress(text.encode(), mtime=0))


if __name__ == "__main__":
    main()
