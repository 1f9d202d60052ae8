"""What a hub costs while it does nothing, while many devices watch it, and
while they send segments as fast as it takes them.
"""

import contextlib
import io
import multiprocessing
import os
import pathlib
import re
import struct
import subprocess
import time

import psycopg2
from hub import processes

from scaling import cores
from scaling.cpu import children, cpu_s, own_cpu_s
from scaling.daemon import Daemon
from scaling.database import Server

_CLIENTS = 16


class Usage:
    """CPU time, transactions and log of a server since a moment."""

    def __init__(self, server: Server, connection) -> None:
        self._server = server
        self._cursor = connection.cursor()
        self._begin = self._read()

    def _read(self) -> tuple:
        self._cursor.execute("SELECT pg_stat_clear_snapshot()")
        self._cursor.execute(
            "SELECT sum(xact_commit), "
            "  (SELECT wal_bytes FROM pg_stat_wal) FROM pg_stat_database"
        )
        return (
            time.monotonic(),
            cpu_s(self._server.pid),
            *(float(value) for value in self._cursor.fetchone()),
        )

    def since(self) -> tuple:
        """Seconds, and in them: CPU seconds, commits, bytes of the log."""
        return tuple(
            now - before for now, before in zip(self._read(), self._begin)
        )


def measure_idle(server: Server, hub: Daemon, connection, seconds: int) -> None:
    time.sleep(5)
    usage = Usage(server, connection)
    before = cpu_s(hub.pid)
    time.sleep(seconds)
    taken, of_server, commits, log = usage.since()
    of_daemon = cpu_s(hub.pid) - before
    print(
        f"idle for {taken:.0f} s: CPU of the daemon "
        f"{100 * of_daemon / taken:.1f} %, of the database "
        f"{100 * of_server / taken:.1f} %; {commits / taken:.1f} transactions "
        f"and {log / taken:.0f} bytes of log per second",
        flush=True,
    )


def measure_watches(
    folder: pathlib.Path, server: Server, programs: dict
) -> None:
    server.create_database("watched")
    work = folder / "watches"
    work.mkdir(exist_ok=True)
    done = subprocess.run(
        [
            *(programs["selfcal_watch_load"], "--folder", work),
            *("--daemon", programs["selfcald"]),
        ],
        check=False,
        cwd=folder,
        env={**os.environ, "SELFCAL_STORE": server.uri("watched")},
    )
    server.drop_database("watched")
    if done.returncode != 0:
        raise processes.Failed("the program with the watches failed")


# --- Throughput.


def _send(
    folder: pathlib.Path,
    server: Server,
    programs: dict,
    replicas: int,
    seconds: int,
) -> dict:
    """What clients of all replicas were acknowledged, and what the database did
    for one segment of it.
    """
    server.create_database("loaded")
    settings = {
        "SELFCAL_STORE": server.uri("loaded"),
        # Segments wait for their score without end, so that acknowledgements do
        # not wait for it; it is computed all the same.
        "SELFCAL_MAX_BACKLOG": "1000000",
        "SELFCAL_SCORING_THREADS": "1",
    }
    others = [
        Daemon(folder, programs["selfcald"], server.uri("loaded"), f"other_{k}")
        for k in range(1, replicas)
    ]
    for other in others:
        other.start("--max-backlog", "1000000", "--scoring-threads", "1")
    clients = subprocess.Popen(
        [
            *(programs["selfcal_daemon_load"], "--folder", folder),
            *("--daemon", programs["selfcald"]),
            *("--clients", str(_CLIENTS), "--seconds", str(seconds)),
            *(word for one in others for word in ("--replica", one.target)),
        ],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, **settings},
    )
    if "begin" not in clients.stdout.readline():
        raise processes.Failed("the clients have not begun")
    pids = [*children(clients.pid), *(other.pid for other in others)]
    with contextlib.closing(server.connect("loaded")) as connection:
        usage = Usage(server, connection)
        of_replicas = -sum(map(cpu_s, pids))
        of_clients = -own_cpu_s(clients.pid)
        line = clients.stdout.readline()
        _, cpu, commits, log = usage.since()
        of_clients += own_cpu_s(clients.pid)
        of_replicas += sum(map(cpu_s, pids))
        found = re.search(r"(\d+) segments stored", line)
        if found is None or int(found[1]) == 0:
            raise processes.Failed(f"no segment was stored: {line}")
        stored = int(found[1])
        cursor = connection.cursor()
        cursor.execute("SELECT count(*) FILTER (WHERE state = 2) FROM segments")
        (scored,) = cursor.fetchone()
        cursor.execute(
            "SELECT rig, sequence FROM payloads ORDER BY rig, sequence LIMIT 1"
        )
        copy = _Copy(cursor, *cursor.fetchone())
    clients.wait()
    for other in others:
        other.stop()
    server.drop_database("loaded")
    return {
        "per_second": stored / seconds,
        "scored": scored / stored,
        "commits": commits / stored,
        "log": log / stored,
        "database_ms": 1e3 * cpu / stored,
        "replicas_ms": 1e3 * of_replicas / stored,
        "clients_ms": 1e3 * of_clients / stored,
        "copy": copy,
    }


class _Copy:
    """The rows that make a segment durable, in the binary form of COPY, which
    the server reads faster than any statement.
    """

    TABLES = ("segments", "payloads", "segment_paths")

    def __init__(self, cursor, rig: int, sequence: int) -> None:
        self._rows = {}
        for table in self.TABLES:
            rows = io.BytesIO()
            cursor.copy_expert(
                f"COPY (SELECT * FROM {table} WHERE rig = {rig} "
                f"AND sequence = {sequence}) TO STDOUT (FORMAT binary)",
                rows,
            )
            self._rows[table] = rows.getvalue()
        self._key = self._field(rig) + self._field(sequence)

    @staticmethod
    def _field(number: int) -> bytes:
        return struct.pack("!iq", 8, number)

    def rows(self, table: str, rig: int, sequence: int) -> io.BytesIO:
        key = self._field(rig) + self._field(sequence)
        row = self._rows[table].replace(self._key, key, 1)
        if table == "segments":  # the session: its name of four letters
            name = struct.pack("!i", 4)
            at = row.index(key) + len(key)
            (size,) = struct.unpack_from("!i", row, at)
            index = at + 4 + size
            row = (
                row[:at]
                + name
                + b"same"
                + self._field(sequence)
                + row[index + 12 :]
            )
        return io.BytesIO(row)


def _write(uri: str, copy: _Copy, rig: int, until: float, written) -> None:
    with contextlib.closing(psycopg2.connect(uri)) as connection:
        cursor = connection.cursor()
        sequence = 0
        while time.time() < until:
            sequence += 1
            for table in copy.TABLES:
                cursor.copy_expert(
                    f"COPY {table} FROM STDIN (FORMAT binary)",
                    copy.rows(table, rig, sequence),
                )
            connection.commit()
        written.put(sequence)


def _write_directly(
    folder: pathlib.Path,
    server: Server,
    programs: dict,
    copy: _Copy,
    seconds: int,
) -> tuple[float, float]:
    """Segments per second that the database itself takes, one in a commit as
    from the daemon, from as many connections as there were clients; and its CPU
    time [ms] for each.
    """
    server.create_database("written")
    hub = Daemon(folder, programs["selfcald"], server.uri("written"), "other_1")
    hub.start()  # creates the schema
    hub.stop()
    with contextlib.closing(server.connect("written")) as connection:
        connection.cursor().execute(
            "INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) "
            "SELECT n, 'rig' || n, 0, '', '' "
            f"FROM generate_series(1, {_CLIENTS}) n"
        )
    written = multiprocessing.Queue()
    until = time.time() + seconds
    writers = [
        multiprocessing.Process(
            target=_write,
            args=(server.uri("written"), copy, rig, until, written),
        )
        for rig in range(1, _CLIENTS + 1)
    ]
    before = cpu_s(server.pid)
    for writer in writers:
        writer.start()
    count = sum(written.get(timeout=seconds + 60) for _ in writers)
    for writer in writers:
        writer.join()
    cpu = cpu_s(server.pid) - before
    server.drop_database("written")
    return count / seconds, 1e3 * cpu / count


def _compare(
    folder: pathlib.Path, server: Server, programs: dict, seconds: int
) -> None:
    """Both sides in turns, for a minute of the machine affects both."""
    for replicas in (1, 2, 3):
        sent = _send(folder, server, programs, replicas, seconds)
        direct, direct_ms = _write_directly(
            folder, server, programs, sent["copy"], seconds
        )
        print(
            f"replicas {replicas}: {sent['per_second']:8.1f} {direct:8.1f}  "
            f"ratio {sent['per_second'] / direct:.2f}; CPU [ms] of the "
            f"database {sent['database_ms']:.2f} {direct_ms:.2f}, of replicas "
            f"{sent['replicas_ms']:.2f}, of clients {sent['clients_ms']:.2f}; "
            f"scored {sent['scored']:.2f}, transactions {sent['commits']:.1f}, "
            f"log {sent['log'] / 1e3:.0f} kB",
            flush=True,
        )


def measure_throughput(
    folder: pathlib.Path, server: Server, programs: dict, seconds: int
) -> None:
    print(
        f"{_CLIENTS} clients, {seconds} s: segments per second acknowledged, "
        "and written to the database directly; for each of these segments, CPU "
        "time of the database; for one acknowledged, the other figures",
        flush=True,
    )
    print("all on the same cores:", flush=True)
    _compare(folder, server, programs, seconds)
    if not cores.can_be_divided():
        return
    print("the database on half of the cores, the others without:", flush=True)
    with cores.divided(server.pid):
        _compare(folder, server, programs, seconds)
