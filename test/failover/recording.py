"""What the devices of the test send: segments of one simulated device, which
the demo makes. Copies differ from each other, and so do their scores.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pathlib
import subprocess
import time

from hub import processes

import selfcal
from failover.local_daemon import LocalDaemon
from selfcal.v1 import rig_pb2, segment_pb2

_SECONDS = 120  # of the recording
# One landmark of so many is kept: scores and runs cost less, and what the fleet
# does with them stays the same.
_THINNING = 3
_KNOCK_PX = 2.0


@dataclasses.dataclass
class Recording:
    rig: rig_pb2.Rig
    segments: list

    def segment(self, number: int) -> segment_pb2.MotionSegment:
        """The `number`-th segment of a device that goes on for ever."""
        copy = segment_pb2.MotionSegment()
        copy.CopyFrom(self.segments[number % len(self.segments)])
        shift_px = 0.01 * (number % 97 - 48)
        z_px = copy.observations.z_px
        for k in range(number % 7, len(z_px), 7):
            z_px[k] += shift_px
        copy.temperature_c = number % 50
        copy.calibration_version = 1
        return copy

    def knocked(self) -> Recording:
        """As the device would record after its principal points have moved."""
        # The daemon leaves out what is outside of the image.
        cameras = self.rig.factory.cameras
        largest_px = min(camera.width_px for camera in cameras) - 1
        moved = Recording(self.rig, [])
        for segment in self.segments:
            copy = segment_pb2.MotionSegment()
            copy.CopyFrom(segment)
            z_px = copy.observations.z_px
            for k in range(0, len(z_px), 2):
                z_px[k] = min(z_px[k] + _KNOCK_PX, largest_px)
            moved.segments.append(copy)
        return moved


def record(folder: pathlib.Path, demo: str, daemon: str) -> Recording:
    kept = folder / "recording"
    subprocess.run(
        [
            *(demo, "--daemon", daemon, "--keep", kept),
            *("--seconds", str(_SECONDS)),
        ],
        check=True,
        cwd=folder,
        stdout=subprocess.DEVNULL,
    )
    (kept / "state").rename(folder / "source")
    source = LocalDaemon(folder, "source", daemon)
    try:
        rig = next(iter(source.daemon.rigs()))
        request = segment_pb2.DownloadSegmentsRequest(parent=rig.name)
        answers = source.daemon.segment_service.DownloadSegments(request)
        segments = [answer.segment for answer in answers]
    finally:
        source.stop()
    if len(segments) < 8:
        raise processes.Failed(f"the demo left {len(segments)} segments")
    return Recording(rig, [_thin(segment) for segment in segments])


def _thin(segment: segment_pb2.MotionSegment) -> segment_pb2.MotionSegment:
    thin = segment_pb2.MotionSegment()
    thin.CopyFrom(segment)
    thin.ClearField("landmarks")
    thin.ClearField("observations")
    landmarks, seen = segment.landmarks, segment.observations
    kept = range(0, len(landmarks.id), _THINNING)
    thin.landmarks.id.extend(landmarks.id[k] for k in kept)
    for k in kept:
        thin.landmarks.p_g.extend(landmarks.p_g[3 * k : 3 * k + 3])
    for k, landmark in enumerate(seen.landmark):
        if landmark in kept:
            thin.observations.keyframe.append(seen.keyframe[k])
            thin.observations.camera.append(seen.camera[k])
            thin.observations.landmark.append(landmark // _THINNING)
            thin.observations.z_px.extend(seen.z_px[2 * k : 2 * k + 2])
    return thin


def digest(segment: segment_pb2.MotionSegment) -> str:
    data = segment.SerializeToString(deterministic=True)
    return hashlib.sha256(data).hexdigest()


def replay(daemon: selfcal.Daemon, rig: rig_pb2.Rig, segments: list) -> dict:
    """Sends segments, in their order, and returns the tables once they are
    scored.
    """
    create = rig_pb2.CreateRigRequest(rig=rig)
    daemon.rig_service.CreateRig(create, timeout=30)
    rig_id = rig.name.rpartition("/")[2]
    requests = (
        segment_pb2.StreamSegmentsRequest(parent=rig.name, segment=segment)
        for segment in segments
    )
    for answer in daemon.stream(requests):
        if answer.verdict != segment_pb2.StreamSegmentsResponse.STORED:
            raise processes.Failed(f"{rig.name}: the reference: {answer}")
    deadline = time.monotonic() + 120
    while any(t.scored < len(segments) for t in daemon.tables(rig_id)):
        if time.monotonic() > deadline:
            raise processes.Failed(f"{rig.name}: the reference is not done")
        time.sleep(0.1)
    return tables_of(daemon, rig_id)


def tables_of(daemon: selfcal.Daemon, rig_id: str) -> dict:
    return {
        table.name: (
            table.scored,
            [
                (e.segment, e.entropy_nats, e.gain_nats, e.sequence)
                for e in table.entries
            ],
        )
        for table in daemon.tables(rig_id)
    }
