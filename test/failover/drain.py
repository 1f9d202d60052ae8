"""What happens when the hub of a device is back: its records are reported in
their order, not faster than allowed.
"""

import signal
import time
from collections.abc import Callable
from typing import Optional

from hub import processes

from failover.load import Context
from failover.proxy import Proxy
from failover.reporting_device import ReportingDevice

_STUCK_S = 120
# Records of about 1 MiB are one report (server/uplink/reporter.cc); and what
# gRPC adds.
_REPORT_BYTES = 1.1 * (1 << 20)
_INFORMATION_BYTES = 8_000  # of the records of a segment, about

# Tables whose records are numbered from 1, and how they name a rig.
_NUMBERED = (
    ("runs", "run", "r.rig"),
    ("calibrations", "version", "r.rig"),
    ("activations", "activation", "r.rig"),
    ("changes", "change", "r.rig"),
    ("events", "event", "r.id"),
)


class Drain:
    def __init__(
        self, context: Context, device: ReportingDevice, proxy: Proxy
    ) -> None:
        self._fleet = context.fleet
        self._device = device
        self._proxy = proxy
        self._rate = 0
        segments = list(device.local.daemon.segments(device.rig_id))
        self._sequences = sorted(s.sequence for s in segments)
        self._bytes_expected = sum(
            _INFORMATION_BYTES + s.has_data * s.payload_bytes for s in segments
        )
        self._before = self._hub()  # the hub has seen the device before
        self._samples: list = []  # time and bytes
        self._records = 0
        self._silence_s = 0.0
        self.seconds = 0.0
        self.wrong: list = []

    def limit(self, seconds: float) -> int:
        """Restarts the device, which may then send so many bytes in a second
        that it takes about `seconds`.
        """
        self._rate = int(self._bytes_expected / seconds)
        rate = ("--uplink-rate", str(self._rate))
        self._device.restart(signal.SIGTERM, *rate)
        return self._rate

    def run(self, disturb: Optional[Callable] = None) -> None:
        """Heals the connection; returns when all is reported."""
        self._records = self._device.uplink().waiting
        before = self._proxy.forwarded
        healed = time.monotonic()
        self._proxy.heal()
        while self._proxy.forwarded == before:
            if time.monotonic() > healed + _STUCK_S:
                raise processes.Failed(f"{self._device.rig_id}: no report")
            time.sleep(0.01)
        begin = time.monotonic()
        self._silence_s = begin - healed
        self._samples = [(begin, before)]
        self._watch(disturb)
        self.seconds = self._samples[-1][0] - begin
        if self._rate and disturb is None:
            self._check_rate()

    def _watch(self, disturb: Optional[Callable]) -> None:
        least = self._records
        progress = time.monotonic()
        last = self._before
        while True:
            waiting = self._device.uplink().waiting
            self._samples.append((time.monotonic(), self._proxy.forwarded))
            there = self._hub()
            self._check_order(last, there)
            last = there
            if waiting == 0:
                return
            if waiting < least:
                least, progress = waiting, time.monotonic()
            if time.monotonic() > progress + _STUCK_S:
                raise processes.Failed(
                    f"{self._device.rig_id}: {waiting} records wait, and none "
                    f"was reported for {_STUCK_S} s"
                )
            if disturb:
                disturb()
            time.sleep(0.1)

    def _hub(self) -> dict:
        """What the hub has so far."""
        fleet = self._fleet
        rig_id = self._device.rig_id
        sequences = fleet.query(
            "SELECT sequence FROM segments JOIN rigs USING (rig) WHERE id = %s",
            rig_id,
        )
        numbers = fleet.query(
            "SELECT p.report, "
            + ", ".join(
                f"ARRAY(SELECT {column} FROM {table} t WHERE t.rig = {rig}"
                " ORDER BY 1)"
                for table, column, rig in _NUMBERED
            )
            + " FROM rigs r JOIN reported_rigs p USING (rig) WHERE id = %s",
            rig_id,
        )[0]
        return {
            "segments": {row[0] for row in sequences},
            "report": numbers[0],
            "numbers": numbers[1:],
        }

    def _check_order(self, last: dict, there: dict) -> None:
        """The hub has all records of a kind up to the last one that it has."""
        name = f"rig {self._device.rig_id}, while it reports"
        segments = there["segments"]
        newest = max(segments)
        missing = [
            sequence
            for sequence in self._sequences
            if sequence <= newest and sequence not in segments
        ]
        if missing:
            self.wrong.append(
                f"{name}: segments {missing[:5]} are missing before {newest}"
            )
        never = segments - set(self._sequences) - self._before["segments"]
        if never:
            self.wrong.append(f"{name}: segments {sorted(never)[:5]} are new")
        for (table, *_), found in zip(_NUMBERED, there["numbers"]):
            if found != list(range(1, len(found) + 1)):
                self.wrong.append(f"{name}: {table}: {found[:50]}")
        if there["report"] < last["report"]:
            self.wrong.append(
                f"{name}: report {there['report']} after {last['report']}"
            )

    def _check_rate(self) -> None:
        """In no time more than allowed, but for one report."""
        for i, (begin, before) in enumerate(self._samples):
            for end, after in self._samples[i + 1 :]:
                allowed = 1.02 * self._rate * (end - begin) + _REPORT_BYTES
                if after - before > allowed:
                    self.wrong.append(
                        f"rig {self._device.rig_id}: {after - before} bytes "
                        f"within {end - begin:.1f} s, of {self._rate} in a "
                        "second"
                    )
                    return

    def text(self) -> str:
        sent = self._samples[-1][1] - self._samples[0][1]
        seconds = max(self.seconds, 0.1)
        return (
            f"begins after {self._silence_s:.1f} s; {self._records} records, "
            f"{sent / 1e6:.1f} MB in {seconds:.1f} s: "
            f"{self._records / seconds:.0f} records/s, "
            f"{sent / seconds / 1e6:.2f} MB/s"
        )
