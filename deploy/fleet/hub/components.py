"""The components of a fleet of one machine: how each starts, and when it is
ready.
"""

import pathlib
import shutil
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from hub import cluster, processes
from hub.one_machine import Fleet


@dataclass
class Component:
    name: str
    command: list[str]
    port: int
    ready: Callable[[], bool]
    seconds: float = 20  # in which it must be ready
    stop: signal.Signals = signal.SIGTERM
    stop_seconds: float = 15
    environment: dict = field(default_factory=dict)


def number(name: str) -> str:
    return name.rsplit("-", 1)[1]


def etcd(fleet: Fleet) -> Iterator[Component]:
    for node in fleet.values["etcd"]:
        port = node["client_port"]
        yield Component(
            node["name"],
            [
                "etcd",
                "--config-file",
                f"{fleet.folder}/etc/{node['name']}.yaml",
            ],
            port,
            lambda port=port: '"true"' in cluster.get(port, "/health")[1],
        )


def patroni(fleet: Fleet) -> Iterator[Component]:
    for node in fleet.values["databases"]:
        yield Component(
            f"patroni-{number(node['name'])}",
            [
                "patroni",
                f"{fleet.folder}/etc/patroni-{number(node['name'])}.yaml",
            ],
            node["rest_port"],
            lambda port=node["rest_port"]: (
                cluster.get(port, "/liveness")[0] == 200
            ),
            # It stops its server, which writes a checkpoint.
            stop_seconds=60,
        )


def pgbouncer(fleet: Fleet) -> Iterator[Component]:
    for node in fleet.values["databases"]:
        port = node["pooler_port"]
        yield Component(
            f"pgbouncer-{number(node['name'])}",
            [
                "/usr/sbin/pgbouncer",
                f"{fleet.folder}/etc/pgbouncer-{number(node['name'])}.ini",
            ],
            port,
            lambda port=port: cluster.accepts(port),
        )


def haproxy(fleet: Fleet) -> Iterator[Component]:
    node = fleet.values["proxies"][0]
    yield Component(
        node["name"],
        ["/usr/sbin/haproxy", "-db", "-f", f"{fleet.folder}/etc/haproxy.cfg"],
        node["service_port"],
        lambda: (
            sum(
                state.startswith("UP")  # also "UP 1/2", one failed check
                for (proxy, server), state in cluster.checks(fleet).items()
                if proxy == "database" and server.startswith("postgres-")
            )
            == 1
        ),
    )


def selfcald(fleet: Fleet) -> Iterator[Component]:
    for node in fleet.values["replicas"]:
        name = node["name"]
        yield Component(
            name,
            [
                fleet.values["daemon"],
                "--config",
                f"{fleet.folder}/etc/{name}.toml",
            ],
            node["port"],
            lambda name=name: (
                cluster.checks(fleet).get(("selfcald", name)) == "UP"
            ),
            seconds=60,
        )


def missing_programs(fleet: Fleet) -> list[str]:
    programs = [
        "etcd",
        "patroni",
        "/usr/sbin/pgbouncer",
        "/usr/sbin/haproxy",
        f"{fleet.values['postgresql']['bin_dir']}/initdb",
    ]
    if fleet.values["backup"]:
        programs.append("pgbackrest")
    return [program for program in programs if shutil.which(program) is None]


def start(fleet: Fleet, component: Component, say: Callable) -> None:
    """Starts a component that does not run, and waits until it is ready."""
    name = component.name
    launch(fleet, component)
    _wait(fleet, component)
    say(name, f"port {component.port}")


def launch(fleet: Fleet, component: Component) -> None:
    if processes.pid_of(fleet.folder, component.name) == 0:
        processes.launch(
            fleet.folder,
            component.name,
            component.command,
            component.environment,
        )


def _wait(fleet: Fleet, component: Component) -> None:
    name = component.name

    def ended() -> bool:
        return processes.pid_of(fleet.folder, name) == 0

    def why_not() -> str:
        what = (
            "it has ended"
            if ended()
            else f"not ready after {component.seconds:g} s"
        )
        return f"{what}; {processes.log_end(fleet.folder, name)}"

    processes.wait_until(
        lambda: ended() or component.ready(), component.seconds, why_not
    )
    if ended():
        raise processes.Failed(why_not())


def postgres_data(fleet: Fleet) -> list[pathlib.Path]:
    return [fleet.folder / node["name"] for node in fleet.values["databases"]]
