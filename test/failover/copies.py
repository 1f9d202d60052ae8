"""Whether the hub has what a device has, as read through the API of both."""

import pathlib
import sqlite3
from collections.abc import Iterator

from google.protobuf.message import Message

import selfcal
from failover import recording
from failover.device import Device
from failover.running_fleet import RunningFleet
from selfcal.v1 import (
    activity_service_pb2,
    calibration_service_pb2,
    recalibration_pb2,
    rig_pb2,
    segment_pb2,
    store_service_pb2,
)

# Rows that no method of the API lists.
_UNLISTED = {
    "changes": "change, time_ns, kind, first_sequence, base_version, inflation",
    "change_groups": "change, group_name",
    "activations": "activation, version, time_ns, steady_ns",
}
_MAX_SHOWN = 5  # differences of a rig


def key_of(name: str) -> tuple:
    """Session and index of the segment with this name; the sessions of the
    test need no encoding.
    """
    session, index = name.rpartition("/")[2].rsplit("~", 1)
    return session, int(index)


def compare(
    device: selfcal.Daemon, hub: selfcal.Daemon, sender: Device, data: str
) -> list:
    """`data` is what the device reports: none, kept, all."""
    rig_id = sender.rig_id
    here = dict(_records(device, rig_id))
    there = dict(_records(hub, rig_id))
    differing = [
        name
        for name in {**here, **there}
        if name not in here
        or name not in there
        or _bytes(here[name]) != _bytes(there[name])
    ]
    wrong = [
        f"rig {rig_id}: {name}: the device has {_text(here, name)}; the hub "
        f"has {_text(there, name)}"
        for name in differing[:_MAX_SHOWN]
    ]
    if len(differing) > _MAX_SHOWN:
        wrong.append(f"rig {rig_id}: {len(differing)} records differ")
    return wrong + _compare_data(device, hub, sender, data)


def _bytes(message: Message) -> bytes:
    # Equal messages would not be equal if they contain a NaN.
    return message.SerializeToString(deterministic=True)


def _text(records: dict, name: str) -> str:
    if name not in records:
        return "nothing"
    return " ".join(str(records[name]).split())[:400]


def _records(daemon: selfcal.Daemon, rig_id: str) -> Iterator[tuple]:
    """Names and messages; without which data of segments is there."""
    rig = f"rigs/{rig_id}"
    request = rig_pb2.GetRigRequest(name=rig)
    yield "the rig", daemon.rig_service.GetRig(request, timeout=30)
    yield "its activity", _activity(daemon, rig_id)
    for segment in daemon.segments(rig_id):
        request = segment_pb2.GetSegmentRequest(name=segment.name)
        whole = daemon.segment_service.GetSegment(request, timeout=30)
        whole.ClearField("has_data")
        whole.ClearField("payload_bytes")
        yield whole.name, whole
        segment_id = whole.name.rpartition("/")[2]
        information = daemon.segment_information(rig_id, segment_id)
        yield f"information of {whole.name}", information
    for table in daemon.tables(rig_id):
        yield table.name, table
    for session in daemon.sessions(rig_id):
        yield session.name, session
        session_id = session.name.rpartition("/")[2]
        for part in daemon.trajectory(rig_id, session_id):
            part.ClearField("has_data")
            yield f"path of {part.segment}", part
    for run in daemon.recalibrations(rig_id):
        request = recalibration_pb2.GetRecalibrationRequest(name=run.name)
        service = daemon.recalibration_service
        yield run.name, service.GetRecalibration(request, timeout=30)
    for version in daemon.calibrations(rig_id):
        request = calibration_service_pb2.GetCalibrationRequest(
            name=version.name
        )
        service = daemon.calibration_service
        yield version.name, service.GetCalibration(request, timeout=30)
    for number, estimate in enumerate(daemon.estimates(rig_id)):
        yield f"estimate {number}", estimate
    for event in daemon.events(rig_id):
        yield f"event {event.number}", event


def _activity(daemon: selfcal.Daemon, rig_id: str) -> Message:
    request = activity_service_pb2.ListActivityRequest(
        filter=f"name = {rig_id}"
    )
    answer = daemon.activity_service.ListActivity(request, timeout=30)
    rig = activity_service_pb2.RigActivity()
    rig.CopyFrom(answer.rigs[0])
    # What each daemon has counted, and how the reports are.
    for field in ("traffic", "uplink", "device", "alarms"):
        rig.ClearField(field)
    return rig


def _compare_data(
    device: selfcal.Daemon, hub: selfcal.Daemon, sender: Device, data: str
) -> list:
    rig_id = sender.rig_id
    here, wrong = _data(device, sender, "the device")
    there, more = _data(hub, sender, "the hub")
    wrong += more
    segments = {key_of(s.name) for s in device.segments(rig_id)}
    expected = {"none": set(), "kept": here, "all": segments}[data]
    wrong += [
        f"rig {rig_id}: the hub has no data of {key}"
        for key in sorted(expected - there)[:_MAX_SHOWN]
    ]
    # It keeps what the device had at the time of the report.
    allowed = set() if data == "none" else segments
    wrong += [
        f"rig {rig_id}: the hub has data of {key}"
        for key in sorted(there - allowed)[:_MAX_SHOWN]
    ]
    return wrong


def _data(daemon: selfcal.Daemon, sender: Device, who: str) -> tuple:
    """Segments with data, and those whose data is not what was sent."""
    keys = set()
    wrong = []
    request = segment_pb2.DownloadSegmentsRequest(parent=sender.rig.name)
    for answer in daemon.segment_service.DownloadSegments(request, timeout=900):
        key = (answer.segment.session, answer.segment.index)
        keys.add(key)
        sent = sender.sent.get(key)
        if not sent or recording.digest(answer.segment) != sent.digest:
            wrong.append(f"{answer.name}: {who} has other data than was sent")
    return keys, wrong


def unlisted_rows_of_device(state: pathlib.Path, rig_id: str) -> dict:
    """Of a daemon that has been stopped."""
    address = f"file:{state}/selfcal.db?mode=ro&immutable=1"
    database = sqlite3.connect(address, uri=True)
    try:
        return {
            table: database.execute(
                f"SELECT {columns} FROM {table} JOIN rigs USING (rig)"
                " WHERE id = ? ORDER BY 1, 2",
                (rig_id,),
            ).fetchall()
            for table, columns in _UNLISTED.items()
        }
    finally:
        database.close()


def unlisted_rows_of_hub(fleet: RunningFleet, rig_id: str) -> dict:
    return {
        table: fleet.query(
            f"SELECT {columns} FROM {table} JOIN rigs USING (rig)"
            " WHERE id = %s ORDER BY 1, 2",
            rig_id,
        )
        for table, columns in _UNLISTED.items()
    }


def has_device_change(daemon: selfcal.Daemon, rig_id: str) -> bool:
    kind = store_service_pb2.Event.CHANGE_DETECTED
    return any(event.kind == kind for event in daemon.events(rig_id))
