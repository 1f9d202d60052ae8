"""A round of a test: devices that send while something fails, and what must
hold afterwards.
"""

import contextlib
import time
from typing import Optional

import grpc
from hub.one_machine import ADDRESS

from failover import checks, recording
from failover.device import Device
from failover.local_daemon import LocalDaemon
from failover.running_fleet import RunningFleet
from selfcal.v1 import rig_pb2

# The rigs of a round, for what each of them shows.
_KEPT = "kept"  # the data of all its segments stays
_RANKED = "ranked"  # better segments replace others, and no run begins
_RUNS = "runs"
_KINDS = (_KEPT, _RANKED, _RUNS)
_DRAIN_S = 120


class Context:
    """What the tests have in common."""

    def __init__(
        self,
        fleet: RunningFleet,
        source: recording.Recording,
        reference: LocalDaemon,
        programs: dict,
        week: int,
    ) -> None:
        self.fleet = fleet
        self.source = source
        self.reference = reference
        self.program = programs["selfcald"]
        self.send_segments = programs.get("send_segments")
        self.earlier = programs.get("earlier")  # an earlier selfcald
        self.week = week  # segments of a week
        self.sent_by_program: Optional[list] = None
        self.rounds = 0  # gives each rig another name


class Load:
    def __init__(
        self,
        context: Context,
        port: int,
        per_second: float,
        fleet: Optional[RunningFleet] = None,
        compare_tables: bool = True,
    ) -> None:
        """Sends to the fleet of the context unless there is another one."""
        context.rounds += 1
        self._context = context
        self._fleet = fleet or context.fleet
        self._compare_tables = compare_tables
        self.devices = []
        self.attempts: list = []  # of each run
        for number, kind in enumerate(_KINDS):
            rig = self._rig(f"{kind}-{context.rounds}-{number}", kind)
            # Beyond ten times its capacity a table counts as full.
            limit = {_RANKED: 110, _KEPT: 400}.get(kind, 1_000_000)
            pace = per_second / 2 if kind == _RANKED else per_second
            self.devices.append(
                Device(f"{ADDRESS}:{port}", rig, context.source, pace, limit)
            )
        for device in self.devices:
            checks.create_rig(self._fleet, device.rig)
        for device in self.devices:
            device.start()

    def _rig(self, rig_id: str, kind: str) -> rig_pb2.Rig:
        rig = rig_pb2.Rig()
        rig.CopyFrom(self._context.source.rig)
        rig.ClearField("create_time")
        rig.name = f"rigs/{rig_id}"
        if kind == _KEPT:
            rig.table_size = 1000
            rig.min_gain_nats = 0
        elif kind == _RANKED:
            # The last table stays empty: one component gains less.
            rig.table_size = 12
            rig.min_gain_nats = 7
            rig.groups.add(group="never", patterns=["imu.accel.scale.z"])
        else:
            rig.table_size = 4
            rig.retrigger_fraction = 0.25
        return rig

    def acknowledged(self) -> int:
        return sum(len(device.acknowledged) for device in self.devices)

    def wait_for_more(self, count: int, seconds: float) -> bool:
        """Waits until so many more segments are acknowledged."""
        before = self.acknowledged()
        deadline = time.monotonic() + seconds
        while self.acknowledged() < before + count:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.02)
        return True

    def wait_until_served(self, deadline: float) -> list:
        """Waits until every device that still sends has an acknowledgement from
        after this call; returns the rigs of those that have none in time.
        """
        since = time.monotonic()
        late = [device for device in self.devices if not device.has_ended()]
        while late and time.monotonic() < deadline:
            late = [d for d in late if d.last_acknowledgement < since]
            time.sleep(0.02)
        return [device.rig_id for device in late]

    def of_kind(self, kind: str) -> list:
        return [d for d in self.devices if d.rig_id.startswith(kind)]

    def abandon(self) -> None:
        for device in self.devices:
            device.abandon()

    def finish(self) -> list:
        """Ends the load; returns what does not hold, a sentence each."""
        for device in self.devices:
            device.close()
        deadline = time.monotonic() + _DRAIN_S
        wrong = []
        for device in self.devices:
            device.join(max(0, deadline - time.monotonic()))
            if device.is_alive():
                wrong.append(
                    f"rig {device.rig_id}: {device.waiting()} segments are "
                    f"not acknowledged after {_DRAIN_S} s"
                )
                device.abandon()
        wrong += self._check()
        if not wrong:
            self._remove()
        return wrong

    def _remove(self) -> None:
        """Deletes the rigs, so that later checks need not read them again."""
        with checks.connect(self._fleet) as daemon:
            for device in self.devices:
                request = rig_pb2.DeleteRigRequest(
                    name=device.rig.name, reason="the round is done"
                )
                # The end of a session may have begun a run: then it stays.
                with contextlib.suppress(grpc.RpcError):
                    daemon.rig_service.DeleteRig(request, timeout=120)

    def _check(self) -> list:
        fleet = self._fleet
        wrong = checks.settled(fleet, [d.rig_id for d in self.devices])
        with checks.connect(fleet) as daemon:
            for device in self.devices:
                kind = device.rig_id.partition("-")[0]
                wrong += checks.segments(fleet, device)
                wrong += checks.data(daemon, device, kind == _KEPT)
                wrong += checks.scores(fleet, device.rig_id)
                found, attempts = checks.runs(fleet, device.rig_id)
                wrong += found
                if kind == _RUNS:
                    self.attempts += attempts
                elif attempts:
                    wrong.append(f"rig {device.rig_id}: a run began")
                elif self._compare_tables:
                    wrong += checks.tables(
                        daemon, self._context.reference, fleet, device
                    )
            wrong += checks.store(daemon)
        return wrong
