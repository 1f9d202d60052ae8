#!/usr/bin/env python3
"""Compares docs/architecture.md with the modules that CMake declares.

    architecture.py [ROOT]

The graph of the document lists for each module what it may include. It may
leave out what the listed modules pass on (USES), and what a line allows to all
modules of a folder ("all of server may include it"); everything else that the
CMakeLists.txt of a module names must be there, and a module must be able to
include everything that is there. Notes in parentheses and what is no name of a
module are not compared, nor are folders whose target is not a selfcal_module.
The table of the document has a row for each module. A line for each
difference, with the line of the document. If any, exit code 1.
"""

import collections
import dataclasses
import pathlib
import re
import sys

import layers

DOCUMENT = "docs/architecture.md"
_OPEN_TO = re.compile(r"all of (\w+) may include it")
_ROW = re.compile(r"\| `([^`]+)` \|")


@dataclasses.dataclass
class Document:
    lines: dict = dataclasses.field(default_factory=dict)  # module -> its line
    # module -> module that it may include -> the line
    listed: dict = dataclasses.field(
        default_factory=lambda: collections.defaultdict(dict)
    )
    open_to: dict = dataclasses.field(default_factory=dict)  # module -> folder
    rows: dict = dataclasses.field(default_factory=dict)  # module -> its line


def parse(text: str) -> Document:
    document = Document()
    without_notes = re.sub(
        r"\([^()]*\)", lambda note: "\n" * note[0].count("\n"), text
    )
    in_block, modules = False, []
    for number, line in enumerate(without_notes.splitlines(), start=1):
        if line.startswith("```"):
            in_block, modules = not in_block, []
            continue
        if not in_block:
            row = _ROW.match(line)
            if row:
                document.rows[row[1]] = number
            continue
        left, arrow, right = line.partition("->")
        if arrow:
            modules = [name.strip() for name in left.split(",")]
        else:
            right = left
        for module in modules:
            document.lines.setdefault(module, number)
            for item in re.split("[,;]", right):
                open_to = _OPEN_TO.search(item)
                if open_to:
                    document.open_to[module] = open_to[1]
                elif len(item.split()) == 1:
                    document.listed[module].setdefault(item.strip(), number)
    return document


def declared_modules(project: layers.Project) -> dict:
    """The targets of each folder that has a module."""
    return {
        folder: targets
        for folder, targets in project.by_folder.items()
        if any(target.is_module for target in targets)
        and folder.split("/")[0] in layers.LAYERS
    }


def false_names(document: Document, root: pathlib.Path) -> list:
    named = [*document.lines.items(), *document.rows.items()]
    for listed in document.listed.values():
        named += listed.items()
    return [
        f"{DOCUMENT}:{number}: there is no module {name}; correct its name or "
        "remove it"
        for name, number in named
        if name.split("/")[0] not in layers.LAYERS or not (root / name).is_dir()
    ]


def _may_omit(document: Document, folder: str, module: str) -> bool:
    return folder.split("/")[0] == document.open_to.get(module)


def undocumented_dependencies(
    document: Document, project: layers.Project
) -> list:
    findings = []
    for folder, targets in declared_modules(project).items():
        listed = document.listed[folder]
        names = set().union(*(t.uses | t.private_uses for t in targets))
        declared = [project.targets[n] for n in names if n in project.targets]
        passed_on = set().union(
            *(
                project.passed_on(target.name)
                for target in declared
                if target.folder in listed
            )
        )
        for used in sorted(declared, key=lambda target: target.name):
            if (
                used.folder != folder
                and used.folder not in listed
                and used.name not in passed_on
                and not _may_omit(document, folder, used.folder)
            ):
                findings.append(
                    f"{DOCUMENT}:{document.lines.get(folder, 1)}: {folder} "
                    f"uses {used.name} of {used.folder}, which the graph does "
                    f"not show; add {used.folder} to the line of {folder}, or "
                    f"remove it from {folder}/CMakeLists.txt"
                )
    return findings


def undeclared_dependencies(
    document: Document, project: layers.Project
) -> list:
    findings = []
    for folder, targets in declared_modules(project).items():
        names = set().union(*(project.reachable(t) for t in targets))
        allowed = {
            project.targets[n].folder for n in names if n in project.targets
        }
        for module, number in document.listed[folder].items():
            if module in project.by_folder and module not in allowed:
                findings.append(
                    f"{DOCUMENT}:{number}: {folder} may not include {module}; "
                    f"remove it, or declare it in {folder}/CMakeLists.txt"
                )
    return findings


def missing_rows(document: Document, project: layers.Project) -> list:
    return [
        f"{DOCUMENT}:1: the table of modules has no row for {folder}; add one"
        for folder in sorted(declared_modules(project))
        if folder not in document.rows
    ]


def main() -> int:
    default = pathlib.Path(__file__).resolve().parents[2]
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else default
    files = [
        file.relative_to(root).as_posix()
        for top in layers.LAYERS
        for file in sorted((root / top).rglob("CMakeLists.txt"))
    ]
    project = layers.Project(root, files)
    document = parse((root / DOCUMENT).read_text(encoding="utf-8"))
    findings = (
        false_names(document, root)
        + undocumented_dependencies(document, project)
        + undeclared_dependencies(document, project)
        + missing_rows(document, project)
    )
    return layers.report(findings, f"{len(declared_modules(project))} modules")


if __name__ == "__main__":
    sys.exit(main())
