"""A device that reports to the hub: a daemon on SQLite with an uplink, a rig
whose segments it stores, and an operator who changes its records.
"""

import random
import shutil
import signal
import time
from collections.abc import Callable

import grpc
from hub import processes

import selfcal
from failover import checks, copies
from failover.device import Device
from failover.load import Context
from failover.local_daemon import LocalDaemon
from failover.tried import wait
from selfcal.v1 import (
    activity_service_pb2,
    calibration_service_pb2,
    recalibration_pb2,
    rig_pb2,
    segment_pb2,
)

_SETTLE_S = 180
# Without progress, until a call of the operator succeeds: on a busy machine a
# run takes a minute, and the next one may begin before the operator's.
_PATIENCE_S = 180
# What a device logs if the hub does not take a report.
_COMPLAINTS = ("refuses the report", "are reported again", "asks again for all")
_Run = recalibration_pb2.Recalibration
_Version = calibration_service_pb2.Calibration


def report_state(daemon: selfcal.Daemon, rig_id: str):
    """The state of the reports about a rig: on a device, of its own; at a hub,
    of those that it took. Empty if there are none.
    """
    request = activity_service_pb2.ListActivityRequest(
        filter=f"name = {rig_id}"
    )
    answer = daemon.activity_service.ListActivity(request, timeout=30)
    for rig in answer.rigs:
        return rig.uplink if rig.HasField("uplink") else rig.device
    return activity_service_pb2.ReportState()


class ReportingDevice:
    """Stores `per_second` segments at most, and not more than it is told to
    (sender.extend()). `data` is its setting uplink-data.
    """

    def __init__(
        self,
        context: Context,
        port: int,
        data: str,
        per_second: float,
    ) -> None:
        context.rounds += 1
        self.rig_id = f"device-{context.rounds}"
        self.data = data
        self._context = context
        self._folder = context.fleet.folder.parent
        self.local = LocalDaemon(
            self._folder,
            self.rig_id,
            context.program,
            (
                *("--uplink", f"insecure:127.0.0.1:{port}"),
                *("--uplink-data", data),
                *("--uplink-interval", "1"),
            ),
        )
        rig = rig_pb2.Rig()
        rig.CopyFrom(context.source.rig)
        rig.ClearField("create_time")
        rig.name = f"rigs/{self.rig_id}"
        rig.table_size = 4
        rig.retrigger_fraction = 0.25
        create = rig_pb2.CreateRigRequest(rig=rig)
        self.local.daemon.rig_service.CreateRig(create, timeout=30)
        self.sender = Device(
            self.local.target, rig, context.source, per_second, 0
        )
        self.sender.start()

    def knock(self) -> None:
        """Moves its cameras: a device change."""
        self.sender.use(self._context.source.knocked())

    def restart(self, how: signal.Signals, *more: str) -> None:
        if how == signal.SIGKILL:
            self.local.kill()
        else:
            self.local.stop()
        self.local.start(*more)

    def store(self, count: int, seconds: float) -> None:
        """Sends so many more segments, and waits until they are stored."""
        self.sender.extend(count)
        expected = len(self.sender.acknowledged) + count
        sender = self.sender
        if not wait(lambda: len(sender.acknowledged) >= expected, seconds):
            raise processes.Failed(
                f"{self.rig_id}: {len(sender.acknowledged)} segments of "
                f"{expected} are stored after {seconds:.0f} s: "
                f"{sender.rejected[:1]}"
            )

    def uplink(self):
        return report_state(self.local.daemon, self.rig_id)

    def stop_sending(self) -> list:
        """Ends the sessions; waits until scores and runs are done."""
        self.sender.close()
        self.sender.join(_SETTLE_S)
        name = f"rig {self.rig_id}"
        wrong = [f"{name}: rejected: {r}" for r in self.sender.rejected]
        if self.sender.is_alive():
            wrong.append(f"{name}: {self.sender.waiting()} segments wait")
            self.sender.abandon()
        quiet = 0
        deadline = time.monotonic() + _SETTLE_S
        while quiet < 4:  # the end of a session may start a run
            quiet = 0 if self.works() else quiet + 1
            if time.monotonic() > deadline:
                return [*wrong, f"{name}: not done after {_SETTLE_S} s"]
            time.sleep(0.4)
        return wrong

    def works(self) -> bool:
        """Whether a segment has no score yet, or a run has not ended."""
        daemon = self.local.daemon
        request = segment_pb2.ListSegmentsRequest(
            parent=f"rigs/{self.rig_id}", page_size=1, filter="state = STORED"
        )
        if daemon.segment_service.ListSegments(request, timeout=30).segments:
            return True
        return any(run.state <= _Run.RUNNING for run in self.runs())

    def runs(self) -> list:
        return list(self.local.daemon.recalibrations(self.rig_id))

    def differences(self) -> list:
        """What the hub has other than the device, once all is reported."""
        name = f"rig {self.rig_id}"
        if not wait(lambda: self.uplink().waiting == 0, _SETTLE_S):
            state = self.uplink()
            return [f"{name}: {state.waiting} records are not reported"]
        log = self.local.log()
        wrong = [
            f"{name}: {line}"
            for line in log.splitlines()
            if any(phrase in line for phrase in _COMPLAINTS)
        ]
        # What the end of a session starts may come after all was reported.
        deadline = time.monotonic() + 30
        while True:
            with checks.connect(self._context.fleet) as hub:
                found = copies.compare(
                    self.local.daemon, hub, self.sender, self.data
                )
            if not found or time.monotonic() > deadline:
                break
            time.sleep(1)
        self.local.stop()
        fleet = self._context.fleet
        here = copies.unlisted_rows_of_device(self.local.state, self.rig_id)
        there = copies.unlisted_rows_of_hub(fleet, self.rig_id)
        if here != there:
            found.append(f"{name}: device changes or activations differ")
        return wrong + found

    def remove(self) -> None:
        """Removes it and, at the hub, its records."""
        shutil.rmtree(self.local.state)
        request = rig_pb2.DeleteRigRequest(
            name=f"rigs/{self.rig_id}", reason="the test is done"
        )
        with checks.connect(self._context.fleet) as hub:
            hub.rig_service.DeleteRig(request, timeout=120)

    # --- What its operator does. Each returns False if it cannot be done now.

    def operate(self, what: Callable) -> None:
        """Does it once it can be done."""
        before = ""
        progress = time.monotonic()
        while True:
            try:
                if what(self):
                    return
                why = "there is nothing to do it with"
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.FAILED_PRECONDITION:
                    raise
                why = error.details()
            if why != before:
                before, progress = why, time.monotonic()
            if time.monotonic() > progress + _PATIENCE_S:
                raise processes.Failed(
                    f"{self.rig_id}: {what.__name__} is not possible: {why}"
                )
            time.sleep(0.3)

    def start_run(self) -> bool:
        before = len(self.runs())
        request = recalibration_pb2.StartRecalibrationRequest(
            parent=f"rigs/{self.rig_id}", force=True
        )
        service = self.local.daemon.recalibration_service
        service.StartRecalibration(request, timeout=30)
        return len(self.runs()) > before

    def activate_another(self) -> bool:
        daemon = self.local.daemon
        usable = (_Version.SUPERSEDED, _Version.ROLLED_BACK)
        versions = [
            version
            for version in daemon.calibrations(self.rig_id)
            if version.state in usable
        ]
        if not versions:
            return False
        request = calibration_service_pb2.ActivateCalibrationRequest(
            name=random.choice(versions).name, reason="tried by the operator"
        )
        daemon.calibration_service.ActivateCalibration(request, timeout=30)
        return True

    def delete_oldest(self) -> bool:
        return self._delete(list(self.local.daemon.segments(self.rig_id))[::-1])

    def delete_any(self) -> bool:
        segments = list(self.local.daemon.segments(self.rig_id))
        return self._delete(random.sample(segments, len(segments)))

    def _delete(self, segments: list) -> bool:
        for segment in segments:
            request = segment_pb2.DeleteSegmentRequest(
                name=segment.name, reason="not wanted"
            )
            try:
                service = self.local.daemon.segment_service
                service.DeleteSegment(request, timeout=30)
                return True
            except grpc.RpcError as error:  # a calibration needs it
                if error.code() != grpc.StatusCode.FAILED_PRECONDITION:
                    raise
        return False

    def quarantine(self) -> bool:
        segments = list(self.local.daemon.segments(self.rig_id))
        session, index = copies.key_of(random.choice(segments).name)
        request = segment_pb2.QuarantineSegmentsRequest(
            parent=f"rigs/{self.rig_id}",
            session=session,
            index=index,
            reason="the lens was covered",
        )
        service = self.local.daemon.segment_service
        answer = service.QuarantineSegments(request, timeout=30)
        return answer.quarantined == 1

    def label(self) -> bool:
        rig = rig_pb2.Rig(name=f"rigs/{self.rig_id}")
        rig.labels["site"] = f"site-{random.randrange(1_000_000)}"
        request = rig_pb2.UpdateRigRequest(rig=rig)
        self.local.daemon.rig_service.UpdateRig(request, timeout=30)
        return True

    def is_changed(self) -> bool:
        """Whether the device change was noticed."""
        return copies.has_device_change(self.local.daemon, self.rig_id)


OPERATIONS = (
    ReportingDevice.start_run,
    ReportingDevice.activate_another,
    ReportingDevice.delete_oldest,
    ReportingDevice.quarantine,
    ReportingDevice.label,
    ReportingDevice.delete_any,
)
