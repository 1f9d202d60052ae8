#!/usr/bin/env python3
"""Pages about the gRPC contract, from its files: one for each of them.

    contract_pages.py DESCRIPTOR_SET OUT_DIR

DESCRIPTOR_SET is protoc's, with source info: comments are the text.
"""

import pathlib
import sys

from google.protobuf import descriptor_pb2 as d
from markdown_lines import escaped

_Field = d.FieldDescriptorProto
_SCALARS = {
    _Field.TYPE_DOUBLE: "double",
    _Field.TYPE_FLOAT: "float",
    _Field.TYPE_INT64: "int64",
    _Field.TYPE_UINT64: "uint64",
    _Field.TYPE_INT32: "int32",
    _Field.TYPE_FIXED64: "fixed64",
    _Field.TYPE_FIXED32: "fixed32",
    _Field.TYPE_BOOL: "bool",
    _Field.TYPE_STRING: "string",
    _Field.TYPE_BYTES: "bytes",
    _Field.TYPE_UINT32: "uint32",
    _Field.TYPE_SFIXED32: "sfixed32",
    _Field.TYPE_SFIXED64: "sfixed64",
    _Field.TYPE_SINT32: "sint32",
    _Field.TYPE_SINT64: "sint64",
}


class _Page:
    """One file of the contract as Markdown."""

    def __init__(self, file: d.FileDescriptorProto) -> None:
        self._file = file
        self._comments = {
            tuple(location.path): location
            for location in file.source_code_info.location
        }
        self.lines: list[str] = []

    def _comment(self, *path: int) -> str:
        location = self._comments.get(path)
        if location is None:
            return ""
        text = location.leading_comments + location.trailing_comments
        return escaped("\n".join(line.strip() for line in text.split("\n")))

    def _cell(self, *path: int) -> str:
        return " ".join(self._comment(*path).split())

    def _head(self, level: int, name: str, *path: int) -> None:
        label = f"{self._file.package}.{name}".lower()
        self.lines += ["", f"({label})=", f"{'#' * level} {name}", ""]
        self.lines += [self._comment(*path), ""]

    def _reference(self, type_name: str) -> str:
        name = type_name.lstrip(".")
        package = self._file.package + "."
        if not name.startswith(package):
            return f"`{name}`"
        return f"{{ref}}`{name[len(package) :]} <{name.lower()}>`"

    def _type(self, field: _Field, nested: dict) -> str:
        if field.type_name in nested:  # a map's entry
            key, value = nested[field.type_name].field
            return f"map of {self._type(key, {})} to {self._type(value, {})}"
        name = _SCALARS.get(field.type) or self._reference(field.type_name)
        if field.label == _Field.LABEL_REPEATED:
            return f"repeated {name}"
        return f"optional {name}" if field.proto3_optional else name

    def service(self, service: d.ServiceDescriptorProto, *path: int) -> None:
        self._head(2, service.name, *path)
        for i, method in enumerate(service.method):
            self._head(3, f"{service.name}.{method.name}", *path, 2, i)
            takes = "stream of " if method.client_streaming else ""
            gives = "stream of " if method.server_streaming else ""
            self.lines += [
                f"Takes: {takes}{self._reference(method.input_type)}.",
                f"Answers: {gives}{self._reference(method.output_type)}.",
            ]

    def message(self, message: d.DescriptorProto, outer: str, *path: int):
        name = f"{outer}{message.name}"
        self._head(2 if not outer else 3, name, *path)
        full = f".{self._file.package}.{name}."
        maps = {
            full + nested.name: nested
            for nested in message.nested_type
            if nested.options.map_entry
        }
        if message.field:
            self.lines += ["| field | type | number | |", "| - | - | - | - |"]
        for i, field in enumerate(message.field):
            what = self._cell(*path, 2, i)
            if field.HasField("oneof_index") and not field.proto3_optional:
                one = message.oneof_decl[field.oneof_index].name
                what = f"one of `{one}`. {what}"
            self.lines.append(
                f"| `{field.name}` | {self._type(field, maps)} "
                f"| {field.number} | {what} |"
            )
        for i, nested in enumerate(message.nested_type):
            if not nested.options.map_entry:
                self.message(nested, f"{name}.", *path, 3, i)
        for i, enum in enumerate(message.enum_type):
            self.enum(enum, f"{name}.", *path, 4, i)

    def enum(self, enum: d.EnumDescriptorProto, outer: str, *path: int) -> None:
        self._head(2 if not outer else 3, f"{outer}{enum.name}", *path)
        self.lines += ["| value | number | |", "| - | - | - |"]
        for i, value in enumerate(enum.value):
            self.lines.append(
                f"| `{value.name}` | {value.number} "
                f"| {self._cell(*path, 2, i)} |"
            )

    def whole(self) -> str:
        name = pathlib.PurePath(self._file.name).stem
        self.lines += [
            f"# {name.replace('_', ' ')}",
            "",
            f"`{self._file.name}`",
        ]
        syntax = self._comments.get((12,))
        if syntax is not None:
            text = "".join(syntax.leading_detached_comments)
            self.lines += ["", escaped(text + syntax.leading_comments)]
        for i, service in enumerate(self._file.service):
            self.service(service, 6, i)
        for i, message in enumerate(self._file.message_type):
            self.message(message, "", 4, i)
        for i, enum in enumerate(self._file.enum_type):
            self.enum(enum, "", 5, i)
        return "\n".join(self.lines) + "\n"


def main() -> None:
    descriptors = d.FileDescriptorSet.FromString(
        pathlib.Path(sys.argv[1]).read_bytes()
    )
    out = pathlib.Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    names = []
    for file in descriptors.file:
        if not file.package.startswith("selfcal."):
            continue
        names.append(pathlib.PurePath(file.name).stem)
        (out / f"{names[-1]}.md").write_text(_Page(file).whole())
    (out / "index.md").write_text(
        "# gRPC\n\nThe contract `selfcal.v1`, made from its files; "
        "[the API](../../api.md) explains how its parts work together.\n\n"
        "```{toctree}\n" + "\n".join(sorted(names)) + "\n```\n"
    )


if __name__ == "__main__":
    main()
