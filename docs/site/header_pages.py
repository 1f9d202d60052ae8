#!/usr/bin/env python3
"""Pages about the public headers, from what doxygen found in them: one for
each of them.

    header_pages.py DOXYGEN_XML HEADERS OUT_DIR

Breathe's own page of a file repeats the namespaces in each, which Sphinx takes
for an error; so here each page names what is in it.
"""

import pathlib
import sys
import xml.etree.ElementTree as ElementTree

from markdown_lines import escaped

_DIRECTIVES = {
    "define": "doxygendefine",
    "function": "doxygenfunction",
    "enum": "doxygenenum",
    "typedef": "doxygentypedef",
    "variable": "doxygenvariable",
}


def opening(header: pathlib.Path) -> list[str]:
    """The comment that a header begins with, as Markdown."""
    out, code = [], False
    for line in header.read_text(encoding="utf-8").splitlines():
        if not line.startswith("//"):
            break
        text = line[2:].removeprefix(" ")
        if text.startswith("  ") != code and text:
            out.append("```" if code else "```cpp")
            code = not code
        out.append(text[2:] if code else escaped(text))
    return out + ["```"] * code


def directive(name: str, argument: str, *options: str) -> list[str]:
    return ["", f"```{{{name}}} {argument}", *options, "```"]


def page(compound: ElementTree.Element, header: pathlib.Path) -> list[str]:
    out = [f"# {compound.findtext('compoundname')}", "", *opening(header)]
    classes = []
    for inner in compound.iter("innerclass"):
        if any(inner.text.startswith(f"{outer}::") for outer in classes):
            continue
        classes.append(inner.text)
        kind = "struct" if inner.get("refid").startswith("struct") else "class"
        out += ["", f"## {inner.text.rsplit('::', 1)[-1]}"]
        out += directive(
            f"doxygen{kind}", inner.text, ":members:", ":undoc-members:"
        )
    others = []
    for member in compound.iter("memberdef"):
        name = member.findtext("qualifiedname") or member.findtext("name")
        if member.get("kind") == "typedef" and name in classes:
            continue  # typedef struct name {...} name, in C
        if member.get("kind") == "function" and "::" in name:
            # The types, for a function that has overloads, as C has none.
            types = ", ".join(
                "".join(p.find("type").itertext()) for p in member.iter("param")
            )
            name += f"({types})"
        others += directive(_DIRECTIVES[member.get("kind")], name)
    return out + (["", "## Functions and values", *others] if others else [])


def main() -> None:
    xml, headers, out = (pathlib.Path(arg) for arg in sys.argv[1:4])
    out.mkdir(parents=True, exist_ok=True)
    names = []
    for path in sorted([*xml.glob("*_8h.xml"), *xml.glob("*_8hpp.xml")]):
        compound = ElementTree.parse(path).find("compounddef")
        header = headers / compound.find("location").get("file")
        names.append(path.stem)
        text = "\n".join(page(compound, header))
        (out / f"{path.stem}.md").write_text(text + "\n")
    (out / "index.md").write_text(
        "# C and C++\n\nThe client library, by its headers as they are "
        "installed; [the API](../../api.md#the-client-library) explains how "
        "they are linked, and what may run at the same time.\n\n"
        "```{toctree}\n" + "\n".join(names) + "\n```\n"
    )


if __name__ == "__main__":
    main()
