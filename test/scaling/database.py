"""A PostgreSQL server of its own, in a folder and behind a socket there."""

import contextlib
import pathlib
import shutil
import signal
import subprocess
import urllib.parse

import psycopg2
from hub import processes

DATABASE = "selfcal"
# Those of a hub with 16 GiB of memory; everything else is PostgreSQL's default.
_SERVING = {
    "shared_buffers": "2GB",
    "effective_cache_size": "8GB",
    "random_page_cost": "1.1",  # of a disk without moving parts
    "max_wal_size": "4GB",
    "max_connections": "300",
    "track_io_timing": "on",
}
# What is filled anew after a crash needs no log.
_FILLING = {
    **_SERVING,
    "fsync": "off",
    "full_page_writes": "off",
    "synchronous_commit": "off",
    "wal_level": "minimal",
    "max_wal_senders": "0",
    "autovacuum": "off",
    "maintenance_work_mem": "1GB",
    "max_wal_size": "8GB",
    "checkpoint_timeout": "30min",
}


def binaries() -> str:
    """The folder of the newest server that is installed; empty: none is."""
    found = [
        path
        for path in pathlib.Path("/usr/lib/postgresql").glob("*/bin")
        if (path / "initdb").exists()
    ]
    return str(max(found, key=lambda path: int(path.parent.name), default=""))


class Server:
    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self._data = folder / "data"

    def create(self) -> None:
        if self._data.exists():
            shutil.rmtree(self._data)
        subprocess.run(
            [
                *(f"{binaries()}/initdb", "-D", self._data, "-U", "postgres"),
                *("--auth=trust", "--encoding=UTF8", "--locale=C.UTF-8"),
                *("--data-checksums", "--no-sync", "--no-instructions"),
            ],
            check=True,
            stdout=subprocess.DEVNULL,
        )

    def start(self, filling: bool = False) -> None:
        command = [f"{binaries()}/postgres", "-D", str(self._data)]
        command += ["-k", str(self.folder), "-c", "listen_addresses="]
        for name, value in (_FILLING if filling else _SERVING).items():
            command += ["-c", f"{name}={value}"]
        processes.launch(self.folder, "postgres", command)
        processes.wait_until(
            self._answers,
            600,
            lambda: processes.log_end(self.folder, "postgres"),
        )

    def stop(self) -> None:
        """With a checkpoint, which may write gigabytes."""
        processes.end(self.folder, "postgres", signal.SIGINT, 600)

    def _answers(self) -> bool:
        try:
            self.connect("postgres").close()
        except psycopg2.OperationalError:
            return False
        return True

    def uri(self, name: str = DATABASE) -> str:
        host = urllib.parse.quote(str(self.folder), safe="")
        return f"postgresql://postgres@{host}/{name}"

    def connect(self, name: str = DATABASE):
        connection = psycopg2.connect(self.uri(name))
        connection.autocommit = True
        return connection

    def create_database(self, name: str) -> None:
        """An empty one, in place of one that an interrupted call left."""
        self.drop_database(name)
        with contextlib.closing(self.connect("postgres")) as connection:
            connection.cursor().execute(f"CREATE DATABASE {name}")

    def drop_database(self, name: str) -> None:
        with contextlib.closing(self.connect("postgres")) as connection:
            connection.cursor().execute(
                f"DROP DATABASE IF EXISTS {name} WITH (FORCE)"
            )

    @property
    def pid(self) -> int:
        return processes.pid_of(self.folder, "postgres")
