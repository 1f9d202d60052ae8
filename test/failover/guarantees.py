"""The guarantees of a replicated hub, each with what it is tried against."""

import contextlib
import os
import random
import re
import signal
import time

import grpc

from failover import checks
from failover.load import Context, Load
from failover.proxy import Proxy
from failover.sender import Sender
from failover.tried import Tried, rounds, wait
from selfcal.v1 import recalibration_pb2

_PER_SECOND = 3  # segments of a device
_FAILOVER_S = 60
_TAKEOVER_S = 60


def _load(context: Context, port: int = 0) -> Load:
    load = Load(context, port or context.fleet.service_port, _PER_SECOND)
    load.wait_for_more(8, 60)
    return load


def lose_primary(context: Context, tried: Tried, trials: int) -> None:
    fleet = context.fleet
    for numbers in rounds(trials):
        load = _load(context)
        for number in numbers:
            time.sleep(random.uniform(0.2, 2))
            primary = fleet.primary()
            index = primary.rpartition("-")[2]
            whole = number % 3 == 2
            names = [primary]
            if whole:  # everything of its machine
                names = [f"patroni-{index}", f"pgbouncer-{index}", primary]
            what = f"{', '.join(names)} killed"
            # What is acknowledged now must not be on the primary alone.
            senders = fleet.senders(primary) if number % 2 == 0 else []
            if senders:
                what += " with the standby behind"
                _signal(senders, signal.SIGSTOP)
                time.sleep(random.uniform(0.5, 1.5))
            begin = time.monotonic()
            fleet.signal(signal.SIGKILL, *names)
            _signal(senders, signal.SIGKILL)
            _wait_until_back(tried, load, begin, what)
            fleet.repair()
        tried.finish(load)


def _signal(pids: list, number: signal.Signals) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def _wait_until_back(
    tried: Tried, load: Load, begin: float, what: str, pause: float = 0.5
) -> None:
    """Until every device has an acknowledgement of after the failure."""
    time.sleep(pause)  # what was under way is acknowledged
    late = load.wait_until_served(begin + _FAILOVER_S)
    seconds = time.monotonic() - begin
    if late:
        tried.trial(f"{what}; no acknowledgement after {seconds:.0f} s")
        tried.fail(f"{what}: {late} are not served")
    else:
        tried.seconds.append(seconds)
        tried.trial(f"{what}; acknowledges again after {seconds:.1f} s")


def lose_replica(context: Context, tried: Tried, trials: int) -> None:
    fleet = context.fleet
    for numbers in rounds(trials):
        load = _load(context)
        for _ in numbers:
            name = random.choice(fleet.replicas())
            begin = time.monotonic()
            fleet.signal(signal.SIGKILL, name)
            _wait_until_back(tried, load, begin, f"{name} killed", 0.1)
            time.sleep(random.uniform(0, 2))
            fleet.start_replica(name)
            time.sleep(random.uniform(0.2, 1.5))
        fleet.wait_for_replicas()
        tried.finish(load)


def partition(context: Context, tried: Tried, trials: int) -> None:
    fleet = context.fleet
    devices = Proxy(fleet.service_port)
    databases = {name: Proxy(fleet.database_port) for name in fleet.replicas()}
    try:
        fleet.connect_replicas({n: p.port for n, p in databases.items()})
        everyone = list(databases.values())
        for numbers in rounds(trials):
            load = _load(context, devices.port)
            for number in numbers:
                _partition(context, tried, load, number, devices, everyone)
            tried.finish(load)
    finally:
        fleet.connect_replicas({})
        for proxy in (devices, *databases.values()):
            proxy.close()


def _partition(context, tried, load, number, devices, databases) -> None:
    where, proxies, how, seconds = [
        ("device and hub", [devices], Proxy.drop, (1, 4)),
        ("one replica and database", databases[:1], Proxy.stall, (11, 15)),
        ("hub and database", databases, Proxy.drop, (1, 4)),
        ("device and hub", [devices], Proxy.stall, (5, 15)),
        ("hub and database", databases, Proxy.stall, (5, 15)),
    ][number % 5]
    if len(proxies) == 1 and where.startswith("one"):
        proxies = [random.choice(databases)]
    length = random.uniform(*seconds)
    sender = Sender(context, f"library-{context.rounds}-{number}", devices.port)
    time.sleep(random.uniform(0, 1.5))
    verb = "dropped" if how is Proxy.drop else "stalled"
    what = f"{where}: {verb} for {length:.1f} s"
    begin = time.monotonic()
    for proxy in proxies:
        how(proxy)
    if where.startswith("one"):
        # The others serve its devices meanwhile.
        what = f"{where}: {verb}"
        _wait_until_back(tried, load, begin, what)
        # Longer than the lease of its claims.
        time.sleep(max(0, begin + length - time.monotonic()))
    else:
        time.sleep(length)
        begin = time.monotonic()
    for proxy in proxies:
        proxy.heal()
    if not where.startswith("one"):
        _wait_until_back(tried, load, begin, what, 0)
    for text in sender.finish():
        tried.fail(f"{what}: {text}")


def stop_worker(context: Context, tried: Tried, trials: int) -> None:
    tried.after = "others take over"
    fleet = context.fleet
    for numbers in rounds(trials, 6):
        load = _load(context)
        for number in numbers:
            trial = _stop_executor if number % 2 else _stop_scorer
            for _ in range(5):  # the work may end before it is stopped
                if trial(context, tried, load):
                    break
            else:
                tried.fail(f"no replica could be stopped: {trial.__name__}")
        fleet.wait_for_replicas()
        tried.finish(load)


def _stop_scorer(context: Context, tried: Tried, load: Load) -> bool:
    device = load.of_kind("ranked")[0]
    if device.has_ended():
        device = load.of_kind("runs")[0]
    device.burst(4)
    return _stop(
        context,
        tried,
        device.rig_id,
        "scored",
        "SELECT count(*) > 0 FROM segments JOIN rigs USING (rig)"
        " WHERE id = %s AND state = 1",
    )


def _stop_executor(context: Context, tried: Tried, load: Load) -> bool:
    rig_id = load.of_kind("runs")[0].rig_id
    # One that was stopped in each trial would not be started again.
    wait(lambda: not _unfinished(context.fleet, rig_id), 60)
    with checks.connect(context.fleet) as daemon:
        request = recalibration_pb2.StartRecalibrationRequest(
            parent=f"rigs/{rig_id}", force=True
        )
        # There may be one already, or nothing to run on.
        with contextlib.suppress(grpc.RpcError):
            daemon.recalibration_service.StartRecalibration(request, timeout=30)
    return _stop(
        context,
        tried,
        rig_id,
        "executed a run",
        "SELECT count(*) > 0 FROM runs JOIN rigs USING (rig)"
        " WHERE id = %s AND state = 2",
    )


def _stop(
    context: Context, tried: Tried, rig_id: str, what: str, works: str
) -> bool:
    """Stops the replica that works on the rig until another has done so."""
    fleet = context.fleet
    deadline = time.monotonic() + 10
    while not fleet.query(works, rig_id)[0][0]:
        if time.monotonic() > deadline:
            return False
    name = fleet.last_scorer(rig_id)
    before = _claim(fleet, rig_id)
    if not name:
        return False
    fleet.signal(signal.SIGSTOP, name)
    begin = time.monotonic()
    try:
        time.sleep(0.3)
        read = len(fleet.log(name))
        if not fleet.query(works, rig_id)[0][0]:
            return False
        if not wait(lambda: _claim(fleet, rig_id) > before, _TAKEOVER_S):
            tried.trial(f"{name} {what}: stopped")
            tried.fail(f"{rig_id}: nobody took over within {_TAKEOVER_S} s")
            return True
        seconds = time.monotonic() - begin
        time.sleep(random.uniform(0.5, 3))  # others do the work, or begin it
    finally:
        fleet.signal(signal.SIGCONT, name)
    lost = re.compile(rf"claim \d+ of rig {rig_id} does not hold")
    dead = re.compile("other daemons have taken this one for dead")

    def knows(pattern) -> bool:
        return bool(pattern.search(fleet.log(name)[read:]))

    if not wait(lambda: knows(lost) or knows(dead), 30):
        tried.fail(f"{name} does not notice that its claim is lost")
    wait(lambda: knows(lost), 3)
    tried.seconds.append(seconds)
    tried.trial(
        f"{name} {what} and was stopped; another took over after "
        f"{seconds:.1f} s; "
        + ("a write of it was refused" if knows(lost) else "it wrote nothing")
    )
    return True


def _unfinished(fleet, rig_id: str) -> int:
    return fleet.query(
        "SELECT count(*) FROM runs JOIN rigs USING (rig)"
        " WHERE id = %s AND state IN (1, 2)",
        rig_id,
    )[0][0]


def _claim(fleet, rig_id: str) -> int:
    rows = fleet.query(
        "SELECT number FROM claims JOIN rigs USING (rig) WHERE id = %s", rig_id
    )
    return rows[0][0] if rows else 0
