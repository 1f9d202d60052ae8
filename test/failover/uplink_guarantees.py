"""The guarantees of the uplink between devices and a replicated hub."""

import itertools
import random
import signal
import time

from hub import processes

from failover import checks
from failover.drain import Drain
from failover.load import Context
from failover.proxy import Http2Proxy, Proxy
from failover.reporting_device import (
    OPERATIONS,
    ReportingDevice,
    report_state,
)
from failover.tried import Tried, rounds, wait
from selfcal.v1 import uplink_pb2

_PER_SECOND = 3  # segments of a device
_BACK_S = 60
_LONG = 1000  # segments; a week with more takes minutes
# What the operator does on each day.
_WEEK = (
    (ReportingDevice.start_run,),
    (ReportingDevice.activate_another, ReportingDevice.delete_oldest),
    (ReportingDevice.start_run,),
    (ReportingDevice.quarantine, ReportingDevice.label),
    (),
    (ReportingDevice.delete_any,),
    (ReportingDevice.activate_another,),
)
_KNOCK_DAY = 4
_UNTHROTTLED = 1000  # segments per second: as fast as they are stored


class _Devices:
    """What the trials of a round have in common."""

    def __init__(self, context: Context, port: int, data: tuple) -> None:
        self._context = context
        self.devices = [
            ReportingDevice(context, port, which, _PER_SECOND) for which in data
        ]
        self.attempts: list = []
        self._operations = itertools.cycle(OPERATIONS)
        for device in self.devices:
            device.store(12, 60)
            device.sender.extend(1_000_000)

    def acknowledged(self) -> int:
        return sum(len(d.sender.acknowledged) for d in self.devices)

    def operate(self) -> None:
        what = next(self._operations)
        for device in self.devices:
            device.operate(what)

    def instruct(self) -> None:
        """Has the hub give each device an instruction."""
        with checks.connect(self._context.fleet) as hub:
            for device in self.devices:
                instruction = uplink_pb2.Instruction()
                rig = instruction.update_rig.rig
                rig.name = f"rigs/{device.rig_id}"
                rig.labels["batch"] = f"batch-{random.randrange(1_000_000)}"
                request = uplink_pb2.CreateInstructionRequest(
                    parent=rig.name, instruction=instruction
                )
                hub.uplink_service.CreateInstruction(request, timeout=30)

    def finish(self) -> list:
        wrong = []
        for device in self.devices:
            wrong += device.stop_sending()
            self.attempts += [run.attempts for run in device.runs()]
            wrong += self._pending(device)
            wrong += device.differences()
        with checks.connect(self._context.fleet) as hub:
            wrong += checks.store(hub)
        if not wrong:
            for device in self.devices:
                device.remove()
        return wrong

    def _pending(self, device: ReportingDevice) -> list:
        """Instructions that were not carried out."""

        def pending() -> list:
            with checks.connect(self._context.fleet) as hub:
                return [
                    f"rig {device.rig_id}: {instruction}"
                    for instruction in hub.instructions(device.rig_id)
                    if instruction.state != uplink_pb2.Instruction.DONE
                ]

        wait(lambda: not pending(), 30)
        return pending()


def cut_uplink(context: Context, tried: Tried, trials: int) -> None:
    tried.after = "reports again"
    proxy = Http2Proxy(context.fleet.service_port)
    try:
        for numbers in rounds(trials):
            devices = _Devices(context, proxy.port, ("all", "kept"))
            for number in numbers:
                _cut(context, tried, devices, number, proxy)
            context.fleet.wait_for_replicas()
            tried.finish(devices)
    finally:
        proxy.close()


def _cut(
    context: Context,
    tried: Tried,
    devices: _Devices,
    number: int,
    proxy: Http2Proxy,
) -> None:
    how = (_reset, _lose_answers, _stall, _flap)[number % 4]
    fleet = context.fleet
    replica = random.choice(fleet.replicas())
    time.sleep(random.uniform(0.2, 1))
    try:
        what = f"{how(context, devices, proxy)}, {replica} killed"
        # The devices may have to turn to another replica as well.
        fleet.signal(signal.SIGKILL, replica)
        for device in devices.devices:
            if device.uplink().waiting == 0:
                tried.fail(f"{what}: nothing waited on {device.rig_id}")
    finally:
        begin = time.monotonic()
        healed_s = time.time()
        proxy.heal()
    left = [
        device
        for device in devices.devices
        if not wait(lambda d=device: _reported_since(d, healed_s), _BACK_S)
    ]
    seconds = time.monotonic() - begin
    tried.trial(f"{what}; reports again after {seconds:.1f} s")
    if left:
        tried.fail(f"{what}: {[d.rig_id for d in left]} do not report")
    else:
        tried.seconds.append(seconds)
    fleet.start_replica(replica)


def _reported_since(device: ReportingDevice, time_s: float) -> bool:
    state = device.uplink()
    taken_s = state.time.seconds + 1e-9 * state.time.nanos
    return taken_s > time_s


def _reset(context: Context, devices: _Devices, proxy: Proxy) -> str:
    length = random.uniform(1, 4)
    proxy.drop()
    devices.operate()
    time.sleep(length)
    return f"reset for {length:.1f} s"


def _stall(context: Context, devices: _Devices, proxy: Proxy) -> str:
    length = random.uniform(3, 8)
    proxy.stall()
    devices.operate()
    time.sleep(length)
    return f"stalled for {length:.1f} s"


def _lose_answers(
    context: Context, devices: _Devices, proxy: Http2Proxy
) -> str:
    """The hub takes reports, and their answers are lost."""
    proxy.lose_answers()
    devices.instruct()

    def taken(device: ReportingDevice) -> bool:
        with checks.connect(context.fleet) as hub:
            there = report_state(hub, device.rig_id).time
        here = device.uplink().time
        return (there.seconds, there.nanos) > (here.seconds, here.nanos)

    for device in devices.devices:
        if not wait(lambda d=device: taken(d), 10):
            raise processes.Failed(f"{device.rig_id}: no report was taken")
    devices.operate()
    time.sleep(random.uniform(0.5, 1.5))
    proxy.drop()
    return "answers to reports lost"


def _flap(context: Context, devices: _Devices, proxy: Proxy) -> str:
    times = random.randint(4, 8)
    for _ in range(times):
        time.sleep(random.uniform(0.1, 0.6))
        proxy.drop()
        time.sleep(random.uniform(0.1, 0.4))
        proxy.heal()
    proxy.drop()
    devices.operate()
    return f"reset {times + 1} times"


def return_after_a_week(context: Context, tried: Tried, trials: int) -> None:
    tried.after = "the hub has all records"
    for number in range(trials):
        proxy = Proxy(context.fleet.service_port)
        try:
            _week(context, tried, number, proxy)
        finally:
            proxy.close()


class _Week:
    """A device that stores a week of segments while its hub is away."""

    def __init__(
        self, context: Context, tried: Tried, data: str, proxy: Proxy
    ) -> None:
        self._context = context
        self.device = ReportingDevice(context, proxy.port, data, _UNTHROTTLED)
        device = self.device
        device.store(8, 60)
        if not wait(lambda: _is_reported(device), 60):
            raise processes.Failed(f"{device.rig_id} does not report")
        proxy.drop()
        for day, operations in enumerate(_WEEK, 1):
            if day == _KNOCK_DAY:
                device.knock()
            device.store(context.week // len(_WEEK), 900)
            for operation in operations:
                device.operate(operation)
            if context.week > _LONG:
                tried.note(f"day {day}: {len(device.sender.sent)} segments")
        self.wrong = device.stop_sending()
        self.attempts = [run.attempts for run in device.runs()]
        if not device.is_changed():
            self.wrong.append(f"rig {device.rig_id}: no device change")
        if len(self.attempts) < 3:
            self.wrong.append(f"rig {device.rig_id}: {len(self.attempts)} runs")

    def acknowledged(self) -> int:
        return len(self.device.sender.acknowledged)

    def finish(self) -> list:
        wrong = self.wrong + self.device.differences()
        with checks.connect(self._context.fleet) as hub:
            wrong += checks.store(hub)
        if not wrong:
            self.device.remove()
        return wrong


def _is_reported(device: ReportingDevice) -> bool:
    state = device.uplink()
    return state.waiting == 0 and state.time.seconds > 0


def _week(context: Context, tried: Tried, number: int, proxy: Proxy) -> None:
    kind = number % 3
    week = _Week(context, tried, "kept" if kind == 2 else "all", proxy)
    drain = Drain(context, week.device, proxy)
    seconds = 60 if context.week > _LONG else 10
    if kind == 0:
        drain.limit(seconds)  # for time to kill something
        kills = _Kills(context, week.device)
        drain.run(kills)
        text = str(kills)
        if kills.replicas == 0:
            drain.wrong.append("all was reported before a replica was killed")
    elif kind == 1:
        rate = drain.limit(seconds)
        drain.run()
        text = f"at most {rate / 1e6:.2f} MB/s are allowed"
    else:
        drain.run()
        text = "nothing else fails"
    tried.seconds.append(drain.seconds)
    tried.trial(f"{week.acknowledged()} segments; {text}; {drain.text()}")
    week.wrong += drain.wrong
    context.fleet.wait_for_replicas()
    tried.finish(week)


class _Kills:
    """Kills the device and a replica in turn, while the device reports."""

    def __init__(self, context: Context, device: ReportingDevice) -> None:
        self._fleet = context.fleet
        self._device = device
        self._due = 0.0
        self.devices = 0
        self.replicas = 0

    def __call__(self) -> None:
        """Called again and again."""
        if time.monotonic() < self._due:
            return
        if self.devices == self.replicas:
            self._device.restart(signal.SIGKILL)
            self.devices += 1
        else:
            replica = random.choice(self._fleet.replicas())
            self._fleet.signal(signal.SIGKILL, replica)
            wait(lambda: self._fleet.pid(replica) == 0, 10)
            self._fleet.start_replica(replica)
            self.replicas += 1
        self._due = time.monotonic() + random.uniform(0.3, 1.5)

    def __str__(self) -> str:
        return (
            f"{self.devices} kills of the device, {self.replicas} of replicas"
        )
