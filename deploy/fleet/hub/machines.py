"""The files of each machine of a fleet, and how they are installed there."""

import pathlib
from dataclasses import dataclass

from hub import settings, templates

_FLEET = pathlib.Path(__file__).resolve().parents[1]

_FOLDERS = {
    "run": "/run/postgresql",
    "run_haproxy": "/run/haproxy",
    "etcd": "/var/lib/etcd/fleet",
    "database": "/var/lib/postgresql/fleet",
    "selfcald": "/var/lib/selfcal",
}
_FILES = {
    "userlist": "/etc/pgbouncer/userlist.txt",
    "pgpass": "/etc/selfcal/pgpass",
    "pgbackrest": "/etc/pgbackrest.conf",
    "create_database": "/etc/patroni/create-database",
}


@dataclass
class Installed:
    """A file of a machine, from a template or as it stands in deploy/fleet."""

    path: str
    source: str
    owner: str = "root"
    mode: int = 0o644


# The components of each part of a machine.
_PARTS = {
    "etcd": [
        Installed("/etc/etcd.yaml", "etcd.yaml", "etcd"),
        Installed("/etc/default/etcd", "etcd.default"),
    ],
    "database": [
        Installed("/etc/patroni/config.yml", "patroni.yaml", "postgres", 0o600),
        Installed(
            _FILES["create_database"], "../create-database", "postgres", 0o755
        ),
        Installed(
            "/etc/pgbouncer/pgbouncer.ini", "pgbouncer.ini", "postgres", 0o600
        ),
        Installed(_FILES["userlist"], "userlist.txt", "postgres", 0o600),
        Installed(_FILES["pgbackrest"], "pgbackrest.conf", "postgres", 0o600),
        Installed(
            "/etc/systemd/system/selfcal-backup@.service", "backup.service"
        ),
        Installed(
            "/etc/systemd/system/selfcal-backup@full.timer", "full.timer"
        ),
        Installed(
            "/etc/systemd/system/selfcal-backup@diff.timer", "diff.timer"
        ),
    ],
    "replica": [
        Installed("/etc/haproxy/haproxy.cfg", "haproxy.cfg"),
        Installed("/etc/selfcal/selfcald.toml", "selfcald.toml", "selfcal"),
        Installed(_FILES["pgpass"], "pgpass", "selfcal", 0o600),
        Installed(
            "/etc/systemd/system/selfcald.service.d/fleet.conf", "selfcald.conf"
        ),
    ],
}

_PORTS = {
    "client_port": 2379,
    "peer_port": 2380,
    "port": 5432,
    "rest_port": 8008,
    "pooler_port": 6432,
    "metrics_port": 9464,
    "service_address": "",
    "service_port": 7447,
    "database_address": "127.0.0.1",
    "database_port": 5000,
}
_DAEMON_PORT = 7448


def _node(name: str, machine: dict, part: str) -> dict:
    node = {"name": name, "address": machine["address"], **_PORTS}
    if part == "replica":
        node["port"] = _DAEMON_PORT
    return node


def _check_machines(machines: object) -> None:
    if not isinstance(machines, dict) or not machines:
        raise settings.Invalid("machines must be names with addresses")
    for name, machine in machines.items():
        if not isinstance(machine, dict) or set(machine) != {"address", "runs"}:
            raise settings.Invalid(
                f"machines.{name} must have address and runs, not {machine}"
            )
        for part in machine["runs"]:
            if part not in _PARTS:
                raise settings.Invalid(
                    f"machines.{name}.runs has {part}; known are: "
                    f"{', '.join(_PARTS)}"
                )


def values_of(inventory: dict) -> dict:
    """The values of the templates, but for those of a machine and passwords;
    settings.Invalid if the inventory is wrong."""
    changes = dict(inventory)
    machines = changes.pop("machines", None)
    _check_machines(machines)
    values = settings.merged(settings.DEFAULTS, changes)
    values["machines"] = machines
    values["system"] = True
    values["scheme"] = "https" if values["tls"] else "http"
    for part, key in (
        ("etcd", "etcd"),
        ("database", "databases"),
        ("replica", "replicas"),
    ):
        values[key] = [
            _node(name, machine, part)
            for name, machine in machines.items()
            if part in machine["runs"]
        ]
    settings.check(values)
    return values


def configure(values: dict, secrets: dict, out: pathlib.Path) -> None:
    """Writes the files of each machine to out/MACHINE."""
    for name, machine in values["machines"].items():
        lines = []
        for part in machine["runs"]:
            known = {
                **values,
                "secrets": secrets,
                "node": _node(name, machine, part),
                "folders": _FOLDERS,
                "files": _FILES,
            }
            for file in _PARTS[part]:
                target = out / name / file.path.lstrip("/")
                templates.write(target, _text(file.source, known), file.mode)
                lines.append(f"{file.owner} {file.mode:o} {file.path}\n")
        templates.write(out / name / "files", "".join(lines), 0o644)
        script = _FLEET / "install"
        templates.write(out / name / "install", script.read_text(), 0o755)


def _text(source: str, known: dict) -> str:
    if source.startswith("../"):
        return (_FLEET / source[3:]).read_text(encoding="utf-8")
    return templates.render(source, known)
