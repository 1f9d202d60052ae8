#!/usr/bin/env python3
"""Checks the includes of all sources against the layers that CMake declares.

    layers.py [ROOT]

A target may include its own headers, those of the targets that its
CMakeLists.txt names (USES, PRIVATE_USES, target_link_libraries), and those that
these name publicly in turn (USES). A line for each include that is not
declared, with what to do about it; also for each declared dependency between
folders that are not layered so, and for each cycle. If any, exit code 1.

The CMakeLists.txt are read as text, with every branch of a condition: no build
is needed, and what only some builds contain is checked as well.
"""

import collections
import dataclasses
import pathlib
import re
import subprocess
import sys

# What the modules of a folder may use. Tests may use everything.
LAYERS = {
    "core": {"core"},
    "proto": {"proto", "core"},
    "migrations": {"migrations"},
    "server": {"server", "migrations", "proto", "core"},
    "client": {"client", "proto", "core"},
}
FOLDERS = (*LAYERS, "test")
# Functions of the project that declare a target with SOURCES and USES.
_DECLARATIONS = {"selfcal_module", "selfcal_test"}
_KEYWORDS = {
    "SOURCES", "LANES", "USES", "PRIVATE_USES", "PROTOS", "IMPORT_DIRS",
    "LABELS", "TIMEOUT", "NOT_SANITIZED", "PUBLIC", "PRIVATE", "INTERFACE",
    "TARGET", "LANGUAGE", "GENERATE_EXTENSIONS", "PLUGIN", "PROTOC_OUT_DIR",
}  # fmt: skip
_INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]')


@dataclasses.dataclass
class Target:
    name: str
    folder: str
    is_library: bool = True
    is_module: bool = False  # declared by selfcal_module
    sources: set = dataclasses.field(default_factory=set)
    uses: set = dataclasses.field(default_factory=set)
    private_uses: set = dataclasses.field(default_factory=set)


def commands(text: str):
    """Yields the name and the arguments of each command of a CMakeLists.txt."""
    token = re.compile(r'"((?:[^"\\]|\\.)*)"|#[^\n]*|([()])|([^\s()"#]+)')
    name, depth, arguments, last = "", 0, [], ""
    for match in token.finditer(text):
        quoted, parenthesis, word = match.groups()
        if parenthesis == "(":
            depth += 1
            if depth == 1:
                name, arguments = last, []
        elif parenthesis == ")":
            depth -= 1
            if depth == 0:
                yield name.lower(), arguments
        elif word is not None or quoted is not None:
            last = word if word is not None else quoted
            if depth > 0:
                arguments.append(last)


def sections(arguments: list) -> dict:
    """Arguments by the keyword before them; '' for the first ones."""
    found = collections.defaultdict(list)
    keyword = ""
    for argument in arguments:
        if argument in _KEYWORDS:
            keyword = argument
        else:
            found[keyword].append(argument)
    return found


class Project:
    def __init__(self, root: pathlib.Path, files: list) -> None:
        self.root = root
        self.files = set(files)
        self.targets: dict = {}
        self.generated: dict = {}  # "selfcal/v1/rig.pb.h" -> its target
        for file in files:
            if file.split("/")[0] in FOLDERS and (
                file.endswith("/CMakeLists.txt")
            ):
                self._read(file)
        self.by_folder = collections.defaultdict(list)
        self.by_source = collections.defaultdict(list)
        for target in self.targets.values():
            self.by_folder[target.folder].append(target)
            for source in target.sources:
                self.by_source[source].append(target)
        self._passed_on: dict = {}

    def _target(self, name: str, folder: str) -> Target:
        return self.targets.setdefault(name, Target(name, folder))

    def _read(self, file: str) -> None:
        folder = str(pathlib.PurePosixPath(file).parent)
        text = (self.root / file).read_text(encoding="utf-8")
        variables = collections.defaultdict(list)
        for name, arguments in commands(text):
            if name == "set" and arguments:
                variables[arguments[0]] += arguments[1:]

        def resolved(arguments: list) -> list:
            values = []
            for argument in arguments:
                match = re.fullmatch(r"\$\{(\w+)\}", argument)
                values += variables[match[1]] if match else [argument]
            return values

        def paths(names: list) -> set:
            return {self._path(folder, name) for name in names}

        in_function = False
        for name, arguments in commands(text):
            if name in ("function", "endfunction"):
                in_function = name == "function"
            if in_function or not arguments:
                continue
            parts = sections(resolved(arguments))
            first = parts[""]
            if name in _DECLARATIONS:
                target = self._target(first[0], folder)
                target.is_library = name != "selfcal_test"
                target.is_module = name == "selfcal_module"
                target.sources |= paths(parts["SOURCES"] + parts["LANES"])
                target.uses |= set(parts["USES"])
                target.private_uses |= set(parts["PRIVATE_USES"])
            elif name == "selfcal_messages_library":
                target = self._target(first[0], folder)
                target.uses |= set(parts["USES"])
                for proto in parts["PROTOS"]:
                    self.generated[f"{proto[:-6]}.pb.h"] = target.name
            elif name in ("add_library", "add_executable"):
                target = self._target(first[0], folder)
                target.is_library = name == "add_library"
                target.sources |= paths(
                    [p for p in first[1:] if p.endswith((".cc", ".proto"))]
                )
            elif name == "target_link_libraries":
                target = self._target(first[0], folder)
                target.uses |= set(parts["PUBLIC"] + parts["INTERFACE"])
                target.private_uses |= set(parts["PRIVATE"] + first[1:])
            elif name == "protobuf_generate":
                extension = (
                    ".grpc.pb.h" if parts["LANGUAGE"] == ["grpc"] else ".pb.h"
                )
                target = self._target(parts["TARGET"][0], folder)
                for source in target.sources:
                    if source.endswith(".proto"):
                        header = source[len(folder) + 1 : -6] + extension
                        self.generated[header] = target.name

    def _path(self, folder: str, name: str) -> str:
        name = name.replace("${PROJECT_SOURCE_DIR}/", "/")
        if name.startswith("/"):
            return name[1:]
        parts: list = []
        for part in f"{folder}/{name}".split("/"):
            if part == "..":
                parts.pop()
            else:
                parts.append(part)
        return "/".join(parts)

    def owners(self, file: str) -> list:
        """The targets that a file is part of; several where nothing tells."""
        if file in self.by_source:
            return self.by_source[file]
        source = re.sub(r"\.h$", ".cc", file)
        if source in self.by_source:
            return self.by_source[source]
        return self.by_folder[str(pathlib.PurePosixPath(file).parent)]

    def providers(self, header: str) -> set:
        """Names of the targets that give a header; empty if it is no one's."""
        if header in self.generated:
            return {self.generated[header]}
        return {t.name for t in self.owners(header) if t.is_library}

    def passed_on(self, name: str) -> set:
        """The targets whose headers one gives its users, itself among them."""
        if name not in self._passed_on:
            seen, waiting = set(), [name]
            while waiting:
                used = waiting.pop()
                if used not in seen:
                    seen.add(used)
                    if used in self.targets:
                        waiting += self.targets[used].uses
            self._passed_on[name] = seen
        return self._passed_on[name]

    def reachable(self, target: Target) -> set:
        """The targets whose headers a target may include, itself among them."""
        direct = target.uses | target.private_uses
        return {target.name}.union(*(self.passed_on(name) for name in direct))


def undeclared_includes(project: Project) -> list:
    findings = []
    for file in sorted(project.files):
        if file.split("/")[0] not in FOLDERS or not file.endswith(
            (".cc", ".h", ".hpp")
        ):
            continue
        owners = project.owners(file)
        if not owners:
            continue
        allowed = set().union(*(project.reachable(t) for t in owners))
        text = (project.root / file).read_text(encoding="utf-8")
        for number, line in enumerate(text.splitlines(), start=1):
            match = _INCLUDE.match(line)
            if not match:
                continue
            header = match[1]
            top = header.split("/")[0]
            if header not in project.generated and (
                top not in FOLDERS or top == "test"
            ):
                continue
            providers = project.providers(header)
            if providers and not providers & allowed:
                owner = owners[0]
                findings.append(
                    f"{file}:{number}: {owner.name} does not declare that it "
                    f"uses {' or '.join(sorted(providers))}, which has "
                    f"{header}; add it to USES in {owner.folder}/"
                    "CMakeLists.txt if the layers allow it, or include "
                    "something else"
                )
    return findings


def forbidden_dependencies(project: Project) -> list:
    findings = []
    for target in project.targets.values():
        layer = LAYERS.get(target.folder.split("/")[0])
        if layer is None:
            continue
        for name in sorted(target.uses | target.private_uses):
            used = project.targets.get(name)
            if used and used.folder.split("/")[0] not in layer:
                top = target.folder.split("/")[0]
                findings.append(
                    f"{target.folder}/CMakeLists.txt: {target.name} uses "
                    f"{name} of {used.folder}, but {top} may only use "
                    f"{', '.join(sorted(layer))}; move the code to where both "
                    "may use it"
                )
    return findings


def cycles(project: Project) -> list:
    findings, done = [], set()

    def visit(name: str, path: tuple) -> None:
        if name in path:
            cycle = " -> ".join((*path[path.index(name) :], name))
            folder = project.targets[name].folder
            findings.append(
                f"{folder}/CMakeLists.txt: a cycle: {cycle}; remove one of "
                "these dependencies"
            )
            return
        if name in done or name not in project.targets:
            return
        target = project.targets[name]
        for used in sorted(target.uses | target.private_uses):
            visit(used, (*path, name))
        done.add(name)

    for name in sorted(project.targets):
        visit(name, ())
    return findings


def tracked_files(root: pathlib.Path) -> list:
    listed = subprocess.run(
        ["git", "-c", "safe.directory=*", "-C", root,
         "ls-files", "--cached", "--others", "--exclude-standard"],
        check=True, capture_output=True, text=True,
    ).stdout.splitlines()  # fmt: skip
    return [file for file in listed if (root / file).is_file()]


def report(findings: list, summary: str) -> int:
    """Prints the findings, or the summary if there are none: the exit code."""
    for line in findings or [summary]:
        print(line)
    return 1 if findings else 0


def main() -> int:
    default = pathlib.Path(__file__).resolve().parents[2]
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else default
    project = Project(root, tracked_files(root))
    findings = (
        undeclared_includes(project)
        + forbidden_dependencies(project)
        + cycles(project)
    )
    return report(
        findings, f"{len(project.targets)} targets, {len(project.files)} files"
    )


if __name__ == "__main__":
    sys.exit(main())
