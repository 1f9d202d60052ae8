"""Writes lists of the contract as Parquet, for data frames and databases::

    python -m selfcal.parquet TARGET LIST [RIG] FILE

where LIST is rigs, segments, calibrations, recalibrations, sessions,
instructions, estimates, events, activity or cohort; or, with messages of one
type from anywhere::

    selfcal.parquet.write("runs.parquet", daemon.recalibrations("tablet"))

Needs the extra ``parquet``: ``pip install 'selfcal[parquet]'``.

The columns are those of ``selfcal ... --csv``: the fields of an item by their
names in the contract, those of a message within it as ``field.name``, and of a
map or of messages that begin with a name of their own as ``field.key`` and
``field.key.name``. Values have their types; what is not set is null, times are
in UTC, enums their names. Repeated numbers and texts are lists, other repeated
fields JSON.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
from collections.abc import Iterable, Iterator
from typing import IO, Any

import grpc
from google.protobuf import json_format
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from selfcal.client import Daemon, connect

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:
    raise ImportError(
        f"selfcal.parquet needs pyarrow ({error}): "
        "pip install 'selfcal[parquet]'"
    ) from error

__all__ = ["table", "write"]

_TYPES = {
    FieldDescriptor.CPPTYPE_INT32: pa.int32(),
    FieldDescriptor.CPPTYPE_INT64: pa.int64(),
    FieldDescriptor.CPPTYPE_UINT32: pa.uint32(),
    FieldDescriptor.CPPTYPE_UINT64: pa.uint64(),
    FieldDescriptor.CPPTYPE_DOUBLE: pa.float64(),
    FieldDescriptor.CPPTYPE_FLOAT: pa.float32(),
    FieldDescriptor.CPPTYPE_BOOL: pa.bool_(),
    FieldDescriptor.CPPTYPE_ENUM: pa.string(),
    FieldDescriptor.CPPTYPE_STRING: pa.string(),
}
_TIME = pa.timestamp("ns", tz="UTC")
_DURATION = pa.duration("ns")

_Cell = tuple[str, pa.DataType, Any]  # column, its type, value


# Rows that are in memory at one time when a file is written.
_BATCH = 10_000


class _Columns:
    """Those of all rows so far."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._types: dict[str, pa.DataType] = {}

    def add(self, row: list[_Cell]) -> None:
        """Adds those that are new, each after the one that it follows."""
        after = 0
        for name, kind, _ in row:
            if name not in self._types:
                self._names.insert(after, name)
                self._types[name] = kind
            after = self._names.index(name) + 1

    def schema(self) -> pa.Schema:
        return pa.schema([(name, self._types[name]) for name in self._names])


def table(messages: Iterable[Message]) -> pa.Table:
    """Returns messages of one type as a table. ValueError if there are none,
    because their type is not known then."""
    columns = _Columns()
    rows = list(_rows(messages, columns))
    return pa.Table.from_pylist(rows, schema=columns.schema())


def write(output: str | IO[bytes], messages: Iterable[Message]) -> None:
    """Writes messages of one type; see `table`. Any number of them: only some
    are in memory at one time, the others in a temporary folder, until the
    columns of all are known."""
    columns = _Columns()
    rows = _rows(messages, columns)
    parts: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        while batch := list(itertools.islice(rows, _BATCH)):
            parts.append(f"{folder}/{len(parts)}")
            pq.write_table(
                pa.Table.from_pylist(batch, schema=columns.schema()), parts[-1]
            )
        schema = columns.schema()
        with pq.ParquetWriter(output, schema) as writer:
            for part in parts:
                writer.write_table(_completed(pq.read_table(part), schema))


def _rows(messages: Iterable[Message], columns: _Columns) -> Iterator[dict]:
    """Adds the columns of each row before it yields it."""
    messages = iter(messages)
    first = next(messages, None)
    if first is None:
        raise ValueError("there is nothing to write")
    columns.add(list(_fields(type(first)(), "", False)))
    for message in itertools.chain([first], messages):
        cells = list(_fields(message, "", True))
        columns.add(cells)
        yield {name: value for name, _, value in cells}


def _completed(part: pa.Table, schema: pa.Schema) -> pa.Table:
    """With null in the columns that it does not have."""
    known = set(part.column_names)
    return pa.Table.from_arrays(
        [
            part[field.name]
            if field.name in known
            else pa.nulls(part.num_rows, field.type)
            for field in schema
        ],
        schema=schema,
    )


def _is_repeated(field: FieldDescriptor) -> bool:
    if hasattr(field, "is_repeated"):
        return field.is_repeated
    return field.label == FieldDescriptor.LABEL_REPEATED  # protobuf before 6


def _json(message: Message) -> str:
    return json_format.MessageToJson(
        message, preserving_proto_field_name=True, indent=None
    )


def _scalar(field: FieldDescriptor, value: Any) -> Any:
    if field.cpp_type != FieldDescriptor.CPPTYPE_ENUM:
        return value
    known = field.enum_type.values_by_number.get(value)
    return known.name if known else str(value)


def _fields(message: Message, prefix: str, is_set: bool) -> Iterator[_Cell]:
    for field in message.DESCRIPTOR.fields:
        yield from _field(message, field, prefix + field.name, is_set)


def _field(
    message: Message, field: FieldDescriptor, name: str, is_set: bool
) -> Iterator[_Cell]:
    value = getattr(message, field.name)
    if _is_repeated(field):
        yield from _repeated(field, value, name)
        return
    has = is_set and (not field.has_presence or message.HasField(field.name))
    if field.message_type is None:
        cell = _scalar(field, value) if has else None
        yield name, _TYPES[field.cpp_type], cell
    elif field.message_type.full_name == "google.protobuf.Timestamp":
        yield name, _TIME, value.ToNanoseconds() if has else None
    elif field.message_type.full_name == "google.protobuf.Duration":
        yield name, _DURATION, value.ToNanoseconds() if has else None
    else:
        yield from _fields(value, name + ".", has)


def _repeated(
    field: FieldDescriptor, values: Any, name: str
) -> Iterator[_Cell]:
    kind = field.message_type
    if kind is None:
        cells = [_scalar(field, value) for value in values]
        yield name, pa.list_(_TYPES[field.cpp_type]), cells
    elif kind.GetOptions().map_entry:
        of = kind.fields_by_name["value"]
        for key in sorted(values):
            if of.message_type is None:
                value = _scalar(of, values[key])
                yield f"{name}.{key}", _TYPES[of.cpp_type], value
            else:
                yield f"{name}.{key}", pa.string(), _json(values[key])
    elif keys := _keys(kind, values):
        for key, value in zip(keys, values):
            yield from _fields(value, f"{name}.{key}.", True)
    elif values:
        yield name, pa.string(), f"[{','.join(map(_json, values))}]"


def _keys(kind: Any, values: Any) -> list[str]:
    """The names with which messages begin; empty if these do not, or if two
    have the same."""
    key = kind.fields_by_number.get(1)
    if (
        key is None
        or _is_repeated(key)
        or key.type != FieldDescriptor.TYPE_STRING
    ):
        return []
    keys = [getattr(value, key.name) for value in values]
    return keys if all(keys) and len(set(keys)) == len(keys) else []


_NO, _YES, _MAYBE = range(3)

# Each with whether it is of one rig.
_LISTS = {
    "rigs": (Daemon.rigs, _NO),
    "segments": (Daemon.segments, _MAYBE),
    "calibrations": (Daemon.calibrations, _MAYBE),
    "recalibrations": (Daemon.recalibrations, _MAYBE),
    "sessions": (Daemon.sessions, _YES),
    "instructions": (Daemon.instructions, _YES),
    "estimates": (Daemon.estimates, _MAYBE),
    "events": (Daemon.events, _MAYBE),
    "activity": (Daemon.rig_activity, _NO),
    "cohort": (lambda daemon: daemon.cohort().components, _NO),
}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m selfcal.parquet",
        description="Writes a list as Parquet.",
    )
    parser.add_argument("target", help="unix:/path or host:port")
    parser.add_argument("list", choices=_LISTS)
    parser.add_argument(
        "rig",
        nargs="?",
        help="of a list of one rig; without it, segments, calibrations, "
        "recalibrations, estimates and events are of all",
    )
    parser.add_argument("file")
    options = parser.parse_args(arguments)
    read, of_rig = _LISTS[options.list]
    if of_rig == _YES and options.rig is None:
        parser.error(f"{options.list}: name the rig")
    if of_rig == _NO and options.rig is not None:
        parser.error(f"{options.list} are not of one rig")
    with connect(options.target) as daemon:
        try:
            rig = [] if options.rig is None else [options.rig]
            write(options.file, read(daemon, *rig))
        except (grpc.RpcError, OSError, ValueError) as error:
            text = (
                error.details() if isinstance(error, grpc.RpcError) else error
            )
            print(f"selfcal.parquet: {text}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
