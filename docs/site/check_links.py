#!/usr/bin/env python3
"""Looks at every link of the site, and of the documents beside the code.

    check_links.py SITE_DIR [MARKDOWN...]

In the site each relative link must lead to a file, and its #anchor to an id in
it; in Markdown to a file of the project, and its #anchor to a heading. Of links
to elsewhere only the form is looked at: there need be no network. A line for
each that is broken; exit code 1 if there is any.
"""

import html.parser
import pathlib
import re
import sys
import urllib.parse

from markdown_lines import prose_lines

_ATTRIBUTES = {"href", "src", "data"}


class _Page(html.parser.HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list) -> None:
        for name, value in attrs:
            if name == "id" or (name == "name" and tag == "a"):
                self.ids.add(value)
            elif name in _ATTRIBUTES and value:
                self.links.append(value)


def well_formed(url: str) -> bool:
    """An address of the web or of mail."""
    parts = urllib.parse.urlsplit(url)
    if parts.scheme == "mailto":
        return "@" in parts.path
    host = r"([a-z0-9-]+\.)+[a-z]{2,}|localhost|[0-9.]+"
    return parts.scheme in ("http", "https") and bool(
        re.fullmatch(host, parts.hostname or "")
    )


def broken_in_site(site: pathlib.Path) -> list[str]:
    pages = {
        path.resolve(): _Page(path.read_text(encoding="utf-8"))
        for path in site.rglob("*.html")
    }
    broken = []
    for path, page in pages.items():
        for link in page.links:
            url = urllib.parse.urlsplit(link)
            if url.scheme == "data":
                continue
            if url.scheme or url.netloc:
                if not well_formed(link):
                    broken.append(f"{path}: {link}: no address")
                continue
            target = path
            if url.path:
                name = urllib.parse.unquote(url.path)
                target = (path.parent / name).resolve()
            if not target.is_file():
                broken.append(f"{path}: {link}: no such file")
            elif url.fragment and target in pages:
                anchor = urllib.parse.unquote(url.fragment)
                if anchor not in pages[target].ids:
                    broken.append(f"{path}: {link}: no such anchor")
    return broken


def _slug(heading: str) -> str:
    """The anchor that hosts of git give a heading."""
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def _prose(path: pathlib.Path) -> str:
    text = path.read_text(encoding="utf-8")
    return "\n".join(line for prose, line in prose_lines(text) if prose)


def broken_in_markdown(path: pathlib.Path) -> list[str]:
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", _prose(path)):
        url = urllib.parse.urlsplit(link)
        if url.scheme:
            if not well_formed(link):
                broken.append(f"{path}: {link}: no address")
            continue
        target = path.parent / url.path if url.path else path
        if not target.exists():
            broken.append(f"{path}: {link}: no such file")
        elif url.fragment:
            headings = re.findall(r"^#+ (.*)$", _prose(target), re.MULTILINE)
            if url.fragment not in map(_slug, headings):
                broken.append(f"{path}: {link}: no such heading")
    return broken


def main() -> int:
    site = pathlib.Path(sys.argv[1])
    if not (site / "index.html").is_file():
        print(f"{site}: no site", file=sys.stderr)
        return 1
    broken = broken_in_site(site)
    for name in sys.argv[2:]:
        broken += broken_in_markdown(pathlib.Path(name))
    for line in broken:
        print(line, file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
