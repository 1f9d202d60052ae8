#!/usr/bin/env python3
"""Copies docs/ to where Sphinx reads it.

    prepare.py ROOT OUT_DIR

The documents are plain Markdown that reads well beside the code, too. What a
site needs besides is added to the copy: links into the code lead to pages with
that code, and each index.md and README.md gets its table of contents, from its
own lists.
"""

import os
import pathlib
import re
import shutil
import sys

from markdown_lines import prose_lines

ROOT, OUT = (pathlib.Path(arg).resolve() for arg in sys.argv[1:3])
DOCS = ROOT / "docs"

_LINK = re.compile(r"\]\(([^)\s]+)\)")
_LANGUAGES = {
    ".cc": "cpp", ".h": "cpp", ".py": "python", ".toml": "toml",
    ".json": "json", ".yml": "yaml", ".proto": "protobuf", ".service": "ini",
}  # fmt: skip
REFERENCE = """
- [C and C++](reference/cpp/index.md): the client library
- [Python](reference/python.rst): the package `selfcal`
- [gRPC](reference/grpc/index.md): the contract
"""


def code_page(path: pathlib.Path) -> pathlib.Path:
    """Makes the page of a file or folder of the project, and returns it."""
    name = path.relative_to(ROOT)
    page = OUT / "code" / f"{name}.md"
    if page.exists():
        return page
    page.parent.mkdir(parents=True, exist_ok=True)
    head = f"---\norphan: true\n---\n# {name}\n\n"
    if path.is_dir():
        page.write_text(head)
        files = sorted(p for p in path.rglob("*") if p.is_file())
        links = [
            f"- [{p.relative_to(path)}]"
            f"({os.path.relpath(code_page(p), page.parent)})"
            for p in files
            if "__pycache__" not in p.parts
        ]
        page.write_text(head + "\n".join(links) + "\n")
    else:
        language = _LANGUAGES.get(path.suffix, "text")
        text = path.read_text(encoding="utf-8")
        page.write_text(f"{head}``````{language}\n{text}\n``````\n")
    return page


def with_code_links(text: str, source: pathlib.Path) -> str:
    def replaced(match: re.Match) -> str:
        if re.match(r"\w+:|#", match[1]):
            return match[0]
        target = (source.parent / match[1].split("#")[0]).resolve()
        if target.is_relative_to(DOCS) or not target.exists():
            return match[0]
        here = (OUT / source.relative_to(DOCS)).parent
        return f"]({os.path.relpath(code_page(target), here)})"

    return "\n".join(
        _LINK.sub(replaced, line) if prose else line
        for prose, line in prose_lines(text)
    )


def contents(index: str) -> str:
    """A hidden table of contents for each section that lists pages."""
    out = []
    for section in re.split(r"^## ", index, flags=re.MULTILINE)[1:]:
        caption = section.splitlines()[0]
        pages = [
            os.path.splitext(link)[0]
            for link in re.findall(r"^- \[[^]]*\]\(([^)]*)\)", section, re.M)
            if not link.startswith("..")
        ]
        if pages:
            out += [
                "",
                "```{toctree}",
                ":hidden:",
                f":caption: {caption}",
                "",
                *pages,
                "```",
            ]
    return "\n".join(out) + "\n"


def main() -> None:
    for source in sorted(DOCS.rglob("*.md")):
        copy = OUT / source.relative_to(DOCS)
        copy.parent.mkdir(parents=True, exist_ok=True)
        text = with_code_links(source.read_text(encoding="utf-8"), source)
        if source == DOCS / "index.md":
            text = text.replace("<!-- reference -->", REFERENCE)
        if source.name in ("index.md", "README.md"):
            text += "\n" + contents(text)
        copy.write_text(text + "\n")
    shutil.copytree(DOCS / "pictures", OUT / "pictures")
    shutil.copytree(
        DOCS / "site" / "reference", OUT / "reference", dirs_exist_ok=True
    )


if __name__ == "__main__":
    main()
