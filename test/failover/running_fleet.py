"""A fleet (deploy/fleet) in a folder, and what the test does to it."""

import contextlib
import os
import pathlib
import re
import signal
import subprocess
import time

import psycopg2
from hub import cluster, components, processes
from hub.one_machine import ADDRESS, Fleet

_COMMANDS = pathlib.Path(__file__).resolve().parents[2] / "deploy/fleet"


class RunningFleet:
    def __init__(self, folder: pathlib.Path, daemon: str) -> None:
        self.folder = folder
        self._daemon = daemon
        self._fleet = Fleet(folder)
        self._stores: dict = {}
        self._link = None

    def create(self, replicas: int, archive: bool = False) -> None:
        options = ["--replicas", str(replicas), "--daemon", self._daemon]
        self.command(
            "start", *(options if archive else [*options, "--no-archive"])
        )
        self._fleet.load()

    def repair(self) -> None:
        """Starts what does not run, and waits for a synchronous standby."""
        for name in self.replicas():
            self.start_replica(name)
        self.command("start")

    def command(self, name: str, *options: str) -> None:
        """Runs a command of deploy/fleet on this fleet."""
        done = subprocess.run(
            [_COMMANDS / name, self.folder, *options],
            check=False,
            cwd=self.folder.parent,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        if done.returncode != 0:
            raise processes.Failed(f"{name}: {done.stdout}")

    # --- Addresses.

    @property
    def service_port(self) -> int:
        return self._fleet.values["proxies"][0]["service_port"]

    @property
    def database_port(self) -> int:
        return self._fleet.values["proxies"][0]["database_port"]

    def database(self, port: int) -> str:
        return (
            f"postgresql://selfcal@{ADDRESS}:{port}/selfcal"
            f"?target_session_attrs=any&passfile={self.folder}/etc/pgpass"
        )

    # --- Components.

    def replicas(self) -> list:
        return [node["name"] for node in self._fleet.values["replicas"]]

    def primary(self) -> str:
        return cluster.primary(self._fleet)

    def pid(self, name: str) -> int:
        return processes.pid_of(self.folder, name)

    def signal(self, number: signal.Signals, *names: str) -> None:
        """Sends a signal to those of the components that run, at once."""
        for pid in [pid for name in names if (pid := self.pid(name))]:
            os.kill(pid, number)

    def senders(self, server: str) -> list:
        """Processes of a server that send its write-ahead log to standbys."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            with contextlib.suppress(OSError, ValueError, IndexError):
                state = (entry / "stat").read_text().rpartition(")")[2]
                command = (entry / "cmdline").read_bytes()
                parent = int(state.split()[1])
                if parent == self.pid(server) and b"walsender" in command:
                    found.append(int(entry.name))
        return found

    def connect_replicas(self, ports: dict) -> None:
        """Restarts the replicas, with their databases at other ports."""
        self._stores = {
            name: self.database(port) for name, port in ports.items()
        }
        for name in self.replicas():
            self.stop_replica(name)
        time.sleep(3)  # until HAProxy's checks have noticed
        for name in self.replicas():
            self.start_replica(name)
        self.wait_for_replicas()

    def use(self, daemon: str) -> None:
        """Replicas that are started from now on run this program."""
        self._fleet.values["daemon"] = daemon
        self._fleet.save()

    def stop_replica(self, name: str) -> None:
        processes.end(self.folder, name, signal.SIGTERM, 20)

    def start_replica(self, name: str) -> None:
        for replica in components.selfcald(self._fleet):
            if replica.name != name:
                continue
            if name in self._stores:
                replica.command += ["--store", self._stores[name]]
            components.launch(self._fleet, replica)

    def wait_for_replicas(self) -> None:
        for replica in components.selfcald(self._fleet):
            processes.wait_until(
                replica.ready,
                60,
                lambda name=replica.name: processes.log_end(self.folder, name),
            )

    # --- What it says.

    def log(self, name: str) -> str:
        file = self.folder / "log" / f"{name}.log"
        if not file.exists():
            return ""
        return file.read_text(encoding="utf-8", errors="replace")

    def metrics(self, name: str) -> str:
        """Those of a replica; empty if it does not answer."""
        for node in self._fleet.values["replicas"]:
            if node["name"] == name:
                return cluster.get(node["metrics_port"], "/metrics")[1]
        return ""

    def last_scorer(self, rig_id: str) -> str:
        """The replica whose log has the rig's last score."""
        line = re.compile(
            rf"^(\S+) .* of rig {re.escape(rig_id)} is scored", re.MULTILINE
        )
        found = [
            (match[-1], name)
            for name in self.replicas()
            if (match := line.findall(self.log(name)))
        ]
        return max(found)[1] if found else ""

    def query(self, sql: str, *values) -> list:
        """Rows of the database; tries for a minute to reach it."""
        deadline = time.monotonic() + 60
        while True:
            try:
                if self._link is None:
                    address = self.database(self.database_port)
                    self._link = psycopg2.connect(address)
                    self._link.autocommit = True
                with self._link.cursor() as cursor:
                    cursor.execute(sql, values)
                    return cursor.fetchall()
            except (psycopg2.OperationalError, psycopg2.InterfaceError):
                self._link = None
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.3)
