"""A restore from a backup and the archive."""

import time

from hub.one_machine import ADDRESS

from failover import checks
from failover.device import Device
from failover.load import Context
from failover.running_fleet import RunningFleet
from failover.tried import Tried, wait
from selfcal.v1 import rig_pb2

_SEGMENTS = 12  # of a rig
_SENT_S = 120


def restore(context: Context, tried: Tried, trials: int) -> None:
    """Uses a fleet of its own, with an archive."""
    tried.after = "serves again"
    folder = context.fleet.folder.with_name("archived")
    fleet = RunningFleet(folder, context.program)
    try:
        fleet.create(replicas=1, archive=True)
        for number in range(trials):
            _restore(context, fleet, tried, number)
    finally:
        fleet.command("stop")


def _restore(
    context: Context, fleet: RunningFleet, tried: Tried, number: int
) -> None:
    in_backup = _send(context, fleet, tried, f"backup-{number}")
    fleet.command("backup", "--type", "incr" if number else "full")
    in_archive = _send(context, fleet, tried, f"archive-{number}")
    sent = [in_backup.rig_id, in_archive.rig_id]
    for text in checks.settled(fleet, sent):
        tried.fail(text)
    restore_to = str(fleet.query("SELECT clock_timestamp()")[0][0])
    time.sleep(1)
    later = _send(context, fleet, tried, f"later-{number}")

    begin = time.monotonic()
    fleet.command("restore", restore_to)
    fleet.repair()
    tried.seconds.append(time.monotonic() - begin)
    rigs = {row[0] for row in fleet.query("SELECT id FROM rigs")}
    if later.rig_id in rigs:
        tried.fail(f"rig {later.rig_id} is of after {restore_to}")
    with checks.connect(fleet) as daemon:
        for device in (in_backup, in_archive):
            for text in checks.segments(fleet, device):
                tried.fail(text)
            for text in checks.data(daemon, device, all_kept=True):
                tried.fail(text)
    after = _send(context, fleet, tried, f"after-{number}")
    for text in checks.settled(fleet, [after.rig_id]):
        tried.fail(text)
    for text in checks.segments(fleet, after):
        tried.fail(text)
    devices = (in_backup, in_archive, later, after)
    tried.segments += sum(len(device.acknowledged) for device in devices)
    tried.trial(f"taken back to {restore_to}")
    tried.checked = tried.trials


def _send(
    context: Context, fleet: RunningFleet, tried: Tried, rig_id: str
) -> Device:
    """A device all of whose segments are acknowledged; their data stays."""
    rig = rig_pb2.Rig()
    rig.CopyFrom(context.source.rig)
    rig.ClearField("create_time")
    rig.name = f"rigs/{rig_id}"
    rig.table_size = 1000
    rig.min_gain_nats = 0
    checks.create_rig(fleet, rig)
    target = f"{ADDRESS}:{fleet.service_port}"
    device = Device(target, rig, context.source, 20, _SEGMENTS)
    device.start()
    if not wait(lambda: len(device.acknowledged) == _SEGMENTS, _SENT_S):
        tried.fail(f"rig {rig_id}: {device.waiting()} are not acknowledged")
    device.abandon()
    device.join()
    return device
