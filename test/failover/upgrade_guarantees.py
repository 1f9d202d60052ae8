"""Upgrade of the replicas from an earlier program to the present one, one after
the other, while devices send.
"""

import time

from hub import processes

from failover import recording
from failover.load import Context, Load
from failover.local_daemon import LocalDaemon
from failover.mixed_replicas import MixedReplicas
from failover.proxy import Proxy
from failover.running_fleet import RunningFleet
from failover.tried import Tried, wait
from selfcal.v1 import rig_pb2

_PER_SECOND = 2  # segments of a device
_MORE = 8  # segments
_SERVED_S = 60
_MIXTURE_S = 120
# Rigs are given up after 5 s without work, and then claimed anew.
_AWAY_S = 7
_BACK_S = 8
_COMPARED = 40  # segments


def upgrade(context: Context, tried: Tried, trials: int) -> None:
    """Each trial has a fleet of its own, which the earlier program creates."""
    tried.after = "every device is served again"
    alike = _score_alike(context)
    if not alike:
        tried.note(
            "tables are not compared: the programs, of different versions or "
            "presets, compute different scores"
        )
    for number in range(trials):
        folder = context.fleet.folder.with_name(f"upgraded-{number + 1}")
        fleet = RunningFleet(folder, context.earlier)
        try:
            fleet.create(replicas=3)
            devices = Proxy(fleet.service_port)
            try:
                load = Load(context, devices.port, _PER_SECOND, fleet, alike)
                _Upgrade(context, fleet, tried, load, devices).run()
                tried.finish(load)
            finally:
                devices.close()
        finally:
            fleet.command("stop")


def _score_alike(context: Context) -> bool:
    """Whether both programs make the same tables of the same segments; then so
    does a mixture of them.
    """
    rig = rig_pb2.Rig()
    rig.CopyFrom(context.source.rig)
    rig.ClearField("create_time")
    rig.name = "rigs/alike"
    rig.table_size = 12
    segments = [context.source.segment(k) for k in range(_COMPARED)]
    for k, segment in enumerate(segments):
        segment.session, segment.index = "s", k
    folder = context.fleet.folder.parent
    earlier = LocalDaemon(folder, "earlier", context.earlier)
    try:
        return recording.replay(
            earlier.daemon, rig, segments
        ) == recording.replay(context.reference.daemon, rig, segments)
    finally:
        earlier.stop()


class _Upgrade:
    """One upgrade of all replicas, under the load of devices that send through
    a proxy.
    """

    def __init__(
        self,
        context: Context,
        fleet: RunningFleet,
        tried: Tried,
        load: Load,
        devices: Proxy,
    ) -> None:
        self._earlier = context.earlier
        self._present = context.program
        self._fleet = fleet
        self._tried = tried
        self._load = load
        self._devices = devices
        self._replicas = MixedReplicas(fleet, context.earlier)
        self._schema = self._read_schema()  # of the earlier program

    def run(self) -> None:
        self._wait_for_more()
        names = self._fleet.replicas()
        for name in names:
            self._restart(name, self._present)
            if name == names[-1]:
                break
            self._wait_until_all_work()
            if name == names[0]:
                self._go_back(name)
        self._wait_for_more()
        self._check(self._replicas.unexpected())
        schema = self._read_schema()
        self._tried.trial(
            f"schema {self._schema} to {schema}; the earlier program: "
            f"{self._replicas.work_of(self._earlier)}; the present one: "
            f"{self._replicas.work_of(self._present)}"
        )

    def _restart(self, name: str, program: str) -> None:
        self._stop(name)
        self._start(name, program)

    def _stop(self, name: str) -> None:
        """Until the other replicas serve its devices."""
        begin = time.monotonic()
        self._check(self._replicas.stop(name))
        late = self._load.wait_until_served(begin + _SERVED_S)
        if late:
            self._check([f"{name} stopped: {late} are not served"])
        else:
            self._tried.seconds.append(time.monotonic() - begin)

    def _start(self, name: str, program: str) -> None:
        if not self._replicas.start(name, program):
            log = self._replicas.log_end(name)
            raise processes.Failed(f"{name} is not ready: {log}")

    def _go_back(self, name: str) -> None:
        """To the earlier program, if the schema permits, and forward again."""
        self._stop(name)
        schema = self._read_schema()
        if schema == self._schema:
            self._start(name, self._earlier)
            self._wait_for_more()
            self._tried.note(f"{name} went back: the schema is the same")
            self._stop(name)
        else:
            self._check_refusal(name, schema)
        self._start(name, self._present)

    def _check_refusal(self, name: str, schema: int) -> None:
        """A newer schema refuses the earlier program and stays as it is."""
        if self._replicas.start(name, self._earlier):
            self._check([f"{name}: the earlier program uses schema {schema}"])
            self._stop(name)
            return
        log = self._replicas.log_end(name)
        if self._fleet.pid(name) != 0:
            self._check([f"{name} neither serves nor ends: {log}"])
            self._fleet.stop_replica(name)
        elif "schema version" not in log:
            self._check([f"{name} ended for another reason: {log}"])
        if self._read_schema() != schema:
            self._check([f"schema {schema} became {self._read_schema()}"])
        self._tried.note(f"{name} cannot go back: the schema is newer")

    def _wait_for_more(self) -> None:
        if not self._load.wait_for_more(_MORE, _SERVED_S):
            self._check([f"no {_MORE} acknowledgements in {_SERVED_S} s"])

    def _wait_until_all_work(self) -> None:
        """Until each replica has acknowledged and scored. Devices go away and
        come back for it: else they and their rigs stay where they are.
        """
        before = self._replicas.work()
        deadline = time.monotonic() + _MIXTURE_S
        idle = list(before)
        while idle and time.monotonic() < deadline:
            self._devices.drop()
            time.sleep(_AWAY_S)
            self._devices.heal()
            wait(lambda: not self._replicas.idle(before), _BACK_S)
            idle = self._replicas.idle(before)
        self._check([f"{name} has no work" for name in idle])
        self._check(self._replicas.unexpected())

    def _read_schema(self) -> int:
        sql = "SELECT max(version) FROM schema_migrations"
        return self._fleet.query(sql)[0][0]

    def _check(self, wrong: list) -> None:
        for text in wrong:
            self._tried.fail(text)
