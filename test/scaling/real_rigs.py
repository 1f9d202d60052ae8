"""Real rigs, made by the daemon on PostgreSQL; their rows are what the
synthetic ones are copied from.
"""

import contextlib
import io
import os
import pathlib
import subprocess

from scaling.daemon import Daemon
from scaling.database import Server

RIG = "simulated"  # that of the demo; names of copies are as long
COUNT = 4
_SECONDS = 300  # of each recording
LABELS = [
    {"model": f"t{model}", "batch": f"2026-{batch:02}", "site": "north"}
    for model in range(1, 6)
    for batch in range(1, 5)
]
# Fields of a SegmentInformationRecord (proto/selfcal/store/records.proto) that
# grow with the number of parameters: Lambda, eta, the unobserved directions,
# the landmarks and the names of the components.
_LARGE_FIELDS = {2, 3, 5, 8, 9}


def make(folder: pathlib.Path, server: Server, programs: dict) -> None:
    """Fills the schema `copied` of the database with their rows."""
    with contextlib.closing(server.connect()) as to:
        cursor = to.cursor()
        cursor.execute("CREATE SCHEMA copied")
        cursor.execute(
            "SELECT table_name FROM information_schema.tables "
            "WHERE table_schema = 'public' AND table_type = 'BASE TABLE' "
            "AND table_name NOT IN ('schema_migrations', 'clock', 'replicas')"
        )
        tables = [name for (name,) in cursor]
        for table in tables:
            cursor.execute(
                f"CREATE TABLE copied.{table} "
                f"(LIKE public.{table}, seed BIGINT)"
            )
        cursor.execute(
            "CREATE TABLE copied.definitions "
            "(seed BIGINT, labels BIGINT, definition BYTEA)"
        )
        for seed in range(1, COUNT + 1):
            _make_one(folder, server, programs, seed)
            database = server.connect(f"real_{seed}")
            with contextlib.closing(database) as source:
                for table in tables:
                    _copy(source.cursor(), cursor, table, seed)
            _label(folder, server, programs["selfcald"], seed, cursor)
        _shorten(cursor)


def _make_one(
    folder: pathlib.Path, server: Server, programs: dict, seed: int
) -> None:
    database = f"real_{seed}"
    server.create_database(database)
    subprocess.run(
        [
            *(programs["selfcal-demo"], "--daemon", programs["selfcald"]),
            *("--keep", folder / database, "--seed", str(seed)),
            *("--seconds", str(_SECONDS)),
        ],
        check=True,
        cwd=folder,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "SELFCAL_STORE": server.uri(database)},
    )


def _copy(source, to, table: str, seed: int) -> None:
    rows = io.BytesIO()
    source.copy_expert(f"COPY (SELECT *, {seed} FROM {table}) TO STDOUT", rows)
    rows.seek(0)
    to.copy_expert(f"COPY copied.{table} FROM STDIN", rows)


def _label(
    folder: pathlib.Path, server: Server, program: str, seed: int, cursor
) -> None:
    """The definition of the rig with each of the labels, as it is stored."""
    database = f"real_{seed}"
    daemon = Daemon(folder, program, server.uri(database), f"hub_{seed}")
    daemon.start()
    with contextlib.closing(server.connect(database)) as source:
        for number, labels in enumerate(LABELS):
            rig = {"name": f"rigs/{RIG}", "labels": labels}
            daemon.call(f"rigs/{RIG}?update_mask=labels", "PATCH", rig)
            read = source.cursor()
            read.execute("SELECT definition FROM rigs")
            cursor.execute(
                "INSERT INTO copied.definitions VALUES (%s, %s, %s)",
                (seed, number, read.fetchone()[0]),
            )
    daemon.stop()


def _varint(record: bytes, at: int) -> tuple[int, int]:
    value, shift = 0, 0
    while True:
        value |= (record[at] & 0x7F) << shift
        shift += 7
        at += 1
        if record[at - 1] < 0x80:
            return value, at


def without_large_fields(record: bytes) -> bytes:
    """The record of a score without what grows with the parameters: the daemon
    reads it as information about nothing.
    """
    kept, at = b"", 0
    while at < len(record):
        begin = at
        key, at = _varint(record, at)
        wire_type = key & 7
        if wire_type == 0:
            _, at = _varint(record, at)
        elif wire_type == 2:
            size, at = _varint(record, at)
            at += size
        else:
            at += 8 if wire_type == 1 else 4
        if key >> 3 not in _LARGE_FIELDS:
            kept += record[begin:at]
    return kept


def _shorten(cursor) -> None:
    cursor.execute("ALTER TABLE copied.segment_information ADD short BYTEA")
    cursor.execute(
        "SELECT seed, sequence, information FROM copied.segment_information"
    )
    for seed, sequence, record in cursor.fetchall():
        cursor.execute(
            "UPDATE copied.segment_information SET short = %s "
            "WHERE seed = %s AND sequence = %s",
            (without_large_fields(bytes(record)), seed, sequence),
        )
