"""The fleet of one machine: its components, folders and ports.

A fleet is a folder. Its layout is decided once, by the first start, and kept in
etc/fleet.yaml.

    etc/    configuration, with passwords
    run/    a file with the process id of each component, and sockets
    log/    what each component writes
    etcd-N, postgres-N, selfcald-N, backup    data
"""

import itertools
import pathlib
import socket

import yaml

from hub import settings, templates

ADDRESS = "127.0.0.1"
_CREATE_DATABASE = (
    pathlib.Path(__file__).resolve().parents[1] / "create-database"
)
_FIRST_PORT = 17400
_LAST_PORT = 32000  # beyond it the system takes ports for its own use

_SMALL = {
    "name": "fleet",
    # Patroni asks for a ttl of 20 at least; versions after 3.0 enforce it.
    "failover": {"ttl": 8, "loop_wait": 1, "retry_timeout": 3},
    "postgresql": {
        "max_connections": 200,
        "shared_buffers": "64MB",
        "max_slot_wal_keep_size": "2GB",
        "parameters": {
            # Little for pg_rewind to copy, and a recovery that begins soon.
            "min_wal_size": "32MB",
            "recovery_init_sync_method": "syncfs",
        },
    },
    "pooler": {"pool_size": 150, "max_client_conn": 400},
    "proxy": {"maxconn": 4000},
    "watchdog": "off",
}


class Fleet:
    """A fleet in a folder, with the values of its templates."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.values: dict = {}

    @property
    def file(self) -> pathlib.Path:
        return self.folder / "etc" / "fleet.yaml"

    def exists(self) -> bool:
        return self.file.is_file()

    def load(self) -> None:
        self.values = yaml.safe_load(self.file.read_text(encoding="utf-8"))

    def save(self) -> None:
        templates.write(self.file, yaml.safe_dump(self.values, sort_keys=False))

    def create(
        self,
        etcd: int,
        databases: int,
        replicas: int,
        port: int,
        strict: bool,
        archive: bool,
        daemon: pathlib.Path,
    ) -> None:
        ports = _ports(2 + 2 * etcd + 3 * databases + 2 * replicas, port)
        node = {"address": ADDRESS}
        values = settings.merged(settings.DEFAULTS, _SMALL)
        values["failover"]["strict"] = strict
        values["backup"] = {
            "repository": {"repo1-path": str(self.folder / "backup")},
            "retention_full": 2,
        }
        if not archive:
            values["backup"] = {}
        values["proxies"] = [
            {
                "name": "haproxy",
                "service_address": ADDRESS,
                "service_port": next(ports),
                "database_address": ADDRESS,
                "database_port": next(ports),
            }
        ]
        values["etcd"] = [
            {
                "name": f"etcd-{k}",
                **node,
                "client_port": next(ports),
                "peer_port": next(ports),
            }
            for k in range(1, etcd + 1)
        ]
        values["databases"] = [
            {
                "name": f"postgres-{k}",
                **node,
                "port": next(ports),
                "rest_port": next(ports),
                "pooler_port": next(ports),
            }
            for k in range(1, databases + 1)
        ]
        values["replicas"] = [
            {
                "name": f"selfcald-{k}",
                **node,
                "port": next(ports),
                "metrics_port": next(ports),
            }
            for k in range(1, replicas + 1)
        ]
        settings.check(values)
        values["daemon"] = str(daemon)
        values["secrets"] = settings.new_passwords()
        self.values = values
        self.save()

    def configure(self) -> None:
        """Writes the configuration of every component."""
        common = {
            **self.values,
            "system": False,
            "scheme": "http",
        }
        etc = self.folder / "etc"
        files = {
            name: str(etc / file)
            for name, file in (
                ("userlist", "userlist.txt"),
                ("pgpass", "pgpass"),
            )
        }

        def write(file: str, template: str, **values) -> None:
            text = templates.render(template, {**common, **values})
            templates.write(etc / file, text)

        def folders(name: str) -> dict:
            return {
                "run": str(self.folder / "run"),
                "run_haproxy": str(self.folder / "run"),
                "etcd": str(self.folder / name),
                "database": str(self.folder / name),
                "selfcald": str(self.folder / name),
            }

        write("userlist.txt", "userlist.txt")
        write("pgpass", "pgpass")
        for node in self.values["etcd"]:
            name = node["name"]
            write(f"{name}.yaml", "etcd.yaml", node=node, folders=folders(name))
        for node in self.values["databases"]:
            name = node["name"]
            number = name.rsplit("-", 1)[1]
            own = {
                **files,
                "pgbackrest": str(etc / f"pgbackrest-{number}.conf"),
                "create_database": str(_CREATE_DATABASE),
            }
            known = {"node": node, "folders": folders(name), "files": own}
            write(f"patroni-{number}.yaml", "patroni.yaml", **known)
            write(f"pgbouncer-{number}.ini", "pgbouncer.ini", **known)
            if self.values["backup"]:
                write(f"pgbackrest-{number}.conf", "pgbackrest.conf", **known)
        proxy = self.values["proxies"][0]
        write("haproxy.cfg", "haproxy.cfg", node=proxy, folders=folders(""))
        for node in self.values["replicas"]:
            name = node["name"]
            write(
                f"{name}.toml",
                "selfcald.toml",
                node={**proxy, **node},
                folders=folders(name),
                files=files,
            )


def _free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((ADDRESS, port))
        except OSError:
            return False
    return True


def _ports(count: int, first: int):
    """`count` consecutive free ports: from `first`, or the first that are."""
    if first:
        taken = [p for p in range(first, first + count) if not _free(p)]
        if taken:
            raise SystemExit(f"fleet: port {taken[0]} is in use")
        return itertools.count(first)
    for candidate in range(_FIRST_PORT, _LAST_PORT - count, 100):
        if all(_free(p) for p in range(candidate, candidate + count)):
            return itertools.count(candidate)
    raise SystemExit(f"fleet: there are no {count} free ports in a row")
