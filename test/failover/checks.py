"""What must hold of rigs whose devices have stopped sending. Each function
returns a sentence for each thing that does not.
"""

import json
import time

import grpc
from hub.one_machine import ADDRESS

import selfcal
from failover import recording
from failover.device import Device
from failover.local_daemon import LocalDaemon
from failover.running_fleet import RunningFleet
from selfcal.v1 import rig_pb2, segment_pb2, store_service_pb2

# Without progress. A run has a low priority: on a busy machine one that takes
# seconds takes minutes.
_STUCK_S = 300
_MAX_ATTEMPTS = 3  # of a run (server/pipeline/run_execution.h)


# A call on a connection to a replica that was just killed is tried again: the
# proxy gives it another one.
_SERVICE_CONFIG = {
    "methodConfig": [
        {
            "name": [{}],
            "retryPolicy": {
                "maxAttempts": 5,
                "initialBackoff": "0.5s",
                "maxBackoff": "4s",
                "backoffMultiplier": 2,
                "retryableStatusCodes": ["UNAVAILABLE"],
            },
        }
    ]
}


def connect(fleet: RunningFleet) -> selfcal.Daemon:
    options = [
        ("grpc.use_local_subchannel_pool", 1),
        ("grpc.max_receive_message_length", 64 << 20),
        ("grpc.initial_reconnect_backoff_ms", 100),
        ("grpc.max_reconnect_backoff_ms", 1000),
        ("grpc.service_config", json.dumps(_SERVICE_CONFIG)),
    ]
    target = f"{ADDRESS}:{fleet.service_port}"
    return selfcal.Daemon(grpc.insecure_channel(target, options))


def create_rig(fleet: RunningFleet, rig: rig_pb2.Rig) -> None:
    """Tries again while the hub cannot be reached."""
    deadline = time.monotonic() + 60
    with connect(fleet) as daemon:
        while True:
            try:
                request = rig_pb2.CreateRigRequest(rig=rig)
                daemon.rig_service.CreateRig(request, timeout=30)
                return
            except grpc.RpcError as error:
                if error.code() == grpc.StatusCode.ALREADY_EXISTS:
                    return  # by a call whose answer was lost
                if time.monotonic() > deadline:
                    raise
            time.sleep(0.3)


def settled(fleet: RunningFleet, rigs: list) -> list:
    """Waits until everything is scored, and every run has ended, as long as
    there is progress.
    """
    sql = (
        "SELECT id, (SELECT count(*) FROM segments s"
        "    WHERE s.rig = r.rig AND state = 1),"
        "  (SELECT count(*) FROM runs u"
        "    WHERE u.rig = r.rig AND state IN (1, 2)),"
        "  (SELECT replica || ' ' || number FROM claims c"
        "    WHERE c.rig = r.rig),"
        "  (SELECT count(*) FROM runs u WHERE u.rig = r.rig)"
        " FROM rigs r WHERE id = ANY(%s)"
    )
    before: list = []
    progress = time.monotonic()
    quiet = 0
    while quiet < 3:  # the end of a run may start another one
        busy = [row for row in fleet.query(sql, rigs) if row[1] or row[2]]
        quiet = 0 if busy else quiet + 1
        # Of each rig: unscored segments, unfinished runs and all runs.
        now = [(row[0], row[1], row[2], row[4]) for row in busy]
        if now != before:
            before, progress = now, time.monotonic()
        if busy and time.monotonic() > progress + _STUCK_S:
            alive = [row[0] for row in fleet.query("TABLE replicas")]
            return [
                f"rig {rig}: {unscored} segments without a score and {runs} "
                f"unfinished runs, unchanged for {_STUCK_S} s; claim {claim}, "
                f"replicas {alive}"
                for rig, unscored, runs, claim, _ in busy
            ]
        time.sleep(0.4)
    return []


def segments(fleet: RunningFleet, device: Device) -> list:
    """Every acknowledged segment is there once, as it was sent."""
    wrong = [f"rig {device.rig_id}: rejected: {r}" for r in device.rejected]
    rows = fleet.query(
        "SELECT session, session_index, sequence, state, problem, keyframes,"
        " imu_samples, landmarks, observations, start_ns"
        " FROM segments JOIN rigs USING (rig) WHERE id = %s ORDER BY sequence",
        device.rig_id,
    )
    stored: dict = {}
    for row in rows:
        key = (row[0], row[1])
        name = f"rig {device.rig_id}: segment {row[0]}~{row[1]}"
        if key in stored:
            wrong.append(f"{name} is there twice")
        stored[key] = row
        if key not in device.sent:
            wrong.append(f"{name} was never sent")
        elif tuple(row[5:]) != device.sent[key].counts:
            wrong.append(f"{name} is not what was sent: {row}")
        if row[3] != 2:
            wrong.append(f"{name} is in state {row[3]}: {row[4]}")
    if [row[2] for row in rows] != list(range(1, len(rows) + 1)):
        wrong.append(f"rig {device.rig_id}: its sequence has gaps")
    for key in device.acknowledged:
        if key not in stored:
            wrong.append(
                f"rig {device.rig_id}: segment {key[0]}~{key[1]} was "
                "acknowledged and is lost"
            )
    return wrong


def data(daemon: selfcal.Daemon, device: Device, all_kept: bool) -> list:
    """The data that is kept is that of the device, bit for bit."""
    wrong = []
    kept = set()
    request = segment_pb2.DownloadSegmentsRequest(parent=device.rig.name)
    for answer in daemon.segment_service.DownloadSegments(request, timeout=300):
        key = (answer.segment.session, answer.segment.index)
        kept.add(key)
        sent = device.sent.get(key)
        if not sent or recording.digest(answer.segment) != sent.digest:
            wrong.append(f"{answer.name} has other data than was sent")
    if all_kept:
        wrong += [
            f"rig {device.rig_id}: the data of {key} is lost"
            for key in device.acknowledged.keys() - kept
        ]
    return wrong


def scores(fleet: RunningFleet, rig_id: str) -> list:
    """Each segment was offered to each table once, since the last change of
    the device that a run has found, if there was one: tables then begin again.
    """
    rows = fleet.query(
        "SELECT group_name, scored, capacity,"
        " (SELECT count(*) FROM segments s WHERE s.rig = t.rig AND state = 2"
        "   AND s.sequence >= (SELECT coalesce(max(c.first_sequence), 0)"
        "     FROM changes c WHERE c.rig = t.rig)),"
        " (SELECT count(*) FROM table_entries e WHERE e.rig = t.rig"
        "   AND e.group_name = t.group_name)"
        " FROM tables t JOIN rigs USING (rig) WHERE id = %s",
        rig_id,
    )
    wrong = [] if rows else [f"rig {rig_id} has no tables"]
    for group, scored, capacity, expected, entries in rows:
        if scored != expected:
            wrong.append(
                f"rig {rig_id}: {scored} scores in table {group} of {expected} "
                "segments"
            )
        if entries > capacity:
            wrong.append(f"rig {rig_id}: {entries} entries in table {group}")
    return wrong


def runs(fleet: RunningFleet, rig_id: str) -> tuple:
    """No run has two results. Also returns how often each was begun."""
    rows, versions = _runs_and_versions(fleet, rig_id)
    name = f"rig {rig_id}"
    wrong = []
    if [row[0] for row in rows] != list(range(1, len(rows) + 1)):
        wrong.append(f"{name}: its runs are not numbered from 1: {rows}")
    if [v[0] for v in versions] != list(range(1, len(versions) + 1)):
        wrong.append(f"{name}: its versions have gaps: {versions}")
    states = [v[2] for v in versions]
    if states.count(1) != 1 or 4 in states:
        wrong.append(f"{name}: not one active version: {versions}")
    if sum(row[4] == 1 and row[5] == 0 for row in rows) > 1:
        wrong.append(f"{name}: two runs because of full tables: {rows}")
    results: dict = {}
    for version, run, _ in versions:
        results.setdefault(run, []).append(version)
    for run, state, attempts, version, _, _, message in rows:
        made = results.get(run, [])
        if state == 3 and made != [version]:
            wrong.append(f"{name}: run {run} has the versions {made}")
        gave_up = state == 4 and attempts >= _MAX_ATTEMPTS
        if state != 3 and not (gave_up and "ended 3 times" in message):
            wrong.append(f"{name}: run {run} is in state {state}: {message}")
        if attempts < 1:
            wrong.append(f"{name}: run {run} was begun {attempts} times")
    return wrong, [row[2] for row in rows]


def _runs_and_versions(fleet: RunningFleet, rig_id: str) -> tuple:
    """As they are while no run is under way: the end of a session starts one
    some seconds later.
    """
    deadline = time.monotonic() + _STUCK_S
    while True:
        read = [
            fleet.query(sql, rig_id)
            for sql in (
                "SELECT run, state, attempts, calibration_version, cause,"
                " change, message FROM runs JOIN rigs USING (rig)"
                " WHERE id = %s ORDER BY run",
                "SELECT version, coalesce(run, 0), state FROM calibrations"
                " JOIN rigs USING (rig) WHERE id = %s ORDER BY version",
            )
        ]
        same = _ended_runs(fleet, rig_id) == len(read[0])
        if same or time.monotonic() > deadline:
            return tuple(read)
        time.sleep(0.5)


def _ended_runs(fleet: RunningFleet, rig_id: str) -> int:
    rows = fleet.query(
        "SELECT count(*), coalesce(min(state), 3) FROM runs"
        " JOIN rigs USING (rig) WHERE id = %s",
        rig_id,
    )
    return rows[0][0] if rows[0][1] > 2 else -1


def tables(
    daemon: selfcal.Daemon,
    reference: LocalDaemon,
    fleet: RunningFleet,
    device: Device,
) -> list:
    """One daemon on SQLite makes the same tables of the same segments."""
    order = fleet.query(
        "SELECT session, session_index FROM segments JOIN rigs USING (rig)"
        " WHERE id = %s ORDER BY sequence",
        device.rig_id,
    )
    if any(tuple(key) not in device.sent for key in order):
        return []  # was reported
    rig = rig_pb2.Rig()
    rig.CopyFrom(device.rig)
    here = recording.tables_of(daemon, device.rig_id)
    there = recording.replay(
        reference.daemon, rig, [device.again(tuple(key)) for key in order]
    )
    if here == there:
        return []
    differing = [name for name in there if here.get(name) != there[name]]
    return [
        f"rig {device.rig_id}: SQLite makes other tables: {name}: "
        f"{here.get(name)} instead of {there[name]}"
        for name in differing or sorted(here)
    ]


def store(daemon: selfcal.Daemon) -> list:
    """The daemon finds no fault in its database."""
    request = store_service_pb2.CheckStoreRequest()
    answers = daemon.store_service.CheckStore(request, timeout=300)
    return [
        f"{answer.problem.place}: {answer.problem.description}"
        for answer in answers
        if answer.HasField("problem")
    ]
