"""A device that sends segments of a recording for ever, as the client library
does: it keeps what is not acknowledged, and sends it again after a failure.
"""

import collections
import contextlib
import dataclasses
import threading
import time

import grpc

import selfcal
from failover import recording
from selfcal.v1 import rig_pb2, segment_pb2

_Response = segment_pb2.StreamSegmentsResponse
_WINDOW = 4  # segments that wait for their acknowledgement
_SESSION = 20  # segments of a session
_SILENCE_S = 45  # without an acknowledgement that it waits for


@dataclasses.dataclass
class Sent:
    """What remains of a segment in the memory of its device."""

    number: int
    digest: str
    counts: tuple  # keyframes, samples, landmarks, observations, start


class Device(threading.Thread):
    def __init__(
        self,
        target: str,
        rig: rig_pb2.Rig,
        source: recording.Recording,
        per_second: float,
        limit: int,
    ) -> None:
        super().__init__(daemon=True)
        self.rig = rig
        self.rig_id = rig.name.rpartition("/")[2]
        self.sent: dict = {}
        self.acknowledged: dict = {}  # key: digest of what was sent
        self.rejected: list = []
        self.connections = 0
        self.cut_off = 0  # connections on which nothing came back
        self.last_acknowledgement = 0.0
        self._target = target
        self._source = source
        self._period_s = 1 / per_second
        self._limit = limit
        self._burst = 0
        self._waiting: collections.OrderedDict = collections.OrderedDict()
        self._changed = threading.Condition()
        self._closing = False
        self._abandoned = False

    def burst(self, count: int) -> None:
        """Sends the next segments without a pause."""
        with self._changed:
            self._burst += count
            self._changed.notify_all()

    def extend(self, count: int) -> None:
        """Sends so many more than it would, and returns at once."""
        with self._changed:
            self._limit += count
            self._changed.notify_all()

    def use(self, source: recording.Recording) -> None:
        """Sends segments of another recording from now on."""
        self._source = source

    def close(self) -> None:
        """Sends nothing new; the thread ends when all is acknowledged."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()

    def abandon(self) -> None:
        with self._changed:
            self._closing = self._abandoned = True
            self._changed.notify_all()

    def has_ended(self) -> bool:
        """True if it sends nothing more: it has reached its limit."""
        return len(self.sent) >= self._limit - 8

    def waiting(self) -> int:
        with self._changed:
            return len(self._waiting)

    def run(self) -> None:
        backoff_s = 0.1
        while not self._is_done():
            before = len(self.acknowledged)
            with contextlib.suppress(grpc.RpcError):
                self._connect()
            if len(self.acknowledged) > before:
                backoff_s = 0.1
            time.sleep(backoff_s)
            backoff_s = min(1, 2 * backoff_s)

    def _is_done(self) -> bool:
        with self._changed:
            return self._abandoned or (self._closing and not self._waiting)

    def _connect(self) -> None:
        self.connections += 1
        options = [
            ("grpc.use_local_subchannel_pool", 1),
            ("grpc.initial_reconnect_backoff_ms", 100),
            ("grpc.max_reconnect_backoff_ms", 1000),
        ]
        over = threading.Event()
        channel = grpc.insecure_channel(self._target, options)
        with selfcal.Daemon(channel) as daemon:
            call = daemon.stream(self._requests(over))
            guard = threading.Thread(target=self._guard, args=(call, over))
            guard.start()
            try:
                for response in call:
                    self._note(response)
            finally:
                with self._changed:
                    over.set()
                    self._changed.notify_all()
                call.cancel()
                guard.join()

    def _guard(self, call, over: threading.Event) -> None:
        """Cancels a call on which nothing comes back."""
        silent_since = time.monotonic()
        seen = -1
        while not over.wait(0.5):
            done = len(self.acknowledged)
            if done != seen or not self._waiting:
                seen, silent_since = done, time.monotonic()
            elif time.monotonic() - silent_since > _SILENCE_S:
                self.cut_off += 1
                call.cancel()
                return
            if self._abandoned:
                call.cancel()
                return

    def _requests(self, over: threading.Event):
        with self._changed:
            again = list(self._waiting.values())
        for message in again:
            yield message
        due = time.monotonic()
        while True:
            with self._changed:
                while not over.is_set():
                    now = time.monotonic()
                    may = len(self._waiting) < _WINDOW + self._burst
                    if self._closing or (may and (self._burst or now >= due)):
                        break
                    self._changed.wait(max(0.01, due - now) if may else 1)
                if over.is_set() or self._closing:
                    return
                if self._burst:
                    self._burst -= 1
            due = max(due + self._period_s, time.monotonic() - 1)
            message = self._next()
            if message is None:
                with self._changed:
                    self._changed.wait_for(
                        lambda: over.is_set() or self._closing or self._may(),
                        3600,
                    )
                continue
            yield message

    def _may(self) -> bool:
        return len(self.sent) < self._limit

    def _next(self):
        if not self._may():
            return None
        number = len(self.sent)
        segment = self._source.segment(number)
        segment.session = f"s{number // _SESSION}"
        segment.index = number % _SESSION
        key = (segment.session, segment.index)
        counts = (
            len(segment.keyframes.t_ns),
            len(segment.imu.t_ns),
            len(segment.landmarks.id),
            len(segment.observations.keyframe),
            segment.keyframes.t_ns[0],
        )
        message = segment_pb2.StreamSegmentsRequest(
            parent=self.rig.name, segment=segment
        )
        with self._changed:
            digest = recording.digest(segment)
            self.sent[key] = Sent(number, digest, counts)
            self._waiting[key] = message
        return message

    def _note(self, response) -> None:
        key = (response.session, response.index)
        with self._changed:
            self._waiting.pop(key, None)
            if response.verdict == _Response.REJECTED:
                self.rejected.append(response)
            else:
                self.acknowledged[key] = self.sent[key].digest
                self.last_acknowledgement = time.monotonic()
            self._changed.notify_all()

    def again(self, key: tuple):
        """The segment as it was sent."""
        segment = self._source.segment(self.sent[key].number)
        segment.session, segment.index = key
        return segment
