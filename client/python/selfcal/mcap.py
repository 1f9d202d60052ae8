"""Writes segments as MCAP, with Foxglove's schemas, for Foxglove, Rerun etc.::

    python -m selfcal.mcap TARGET RIG FOLDER [SEGMENT...] [--version VERSION]

writes a file for each session, FOLDER/SESSION.mcap, with the named segments
(``session~index``) or all segments whose data is kept. Needs the extra
``mcap``: ``pip install 'selfcal[mcap]'``.

Frames are G (the session's), I (the body), A (the accelerometer), cam0, cam1,
..., and J and A1 for the gyroscope and the accelerometer of a second IMU; times
are those of the session's clock.

==================== ================================== =====================
topic                schema                             one message for each
==================== ================================== =====================
/tf                  foxglove.FrameTransform            keyframe: I in G; and
                                                        segment: A, camN, J
                                                        in I, A1 in J
/keyframes           foxglove.PoseInFrame               keyframe: I in G
/motion              selfcal.mcap.KeyframeMotion        keyframe
/imu, /imu1          selfcal.mcap.ImuReading            sample
/landmarks           foxglove.PointCloud                segment, in G
/camN/calibration    foxglove.CameraCalibration         segment
/camN/observations   foxglove.ImageAnnotations          keyframe
==================== ================================== =====================
"""

from __future__ import annotations

import argparse
import os
import pathlib
import sys
import urllib.parse
from collections.abc import Iterable
from typing import IO

import grpc

from selfcal.client import Tls, connect
from selfcal.v1 import calibration_pb2 as v1, segment_pb2

try:
    from mcap_protobuf.writer import Writer

    from selfcal import _foxglove
except ImportError as error:
    raise ImportError(
        "selfcal.mcap needs packages that are not installed, or are too old "
        f"({error}): pip install 'selfcal[mcap]'"
    ) from error

__all__ = ["write"]


def write(
    output: str | IO[bytes],
    segments: Iterable[segment_pb2.MotionSegment],
    calibration: v1.CalibrationParameters,
) -> list[str]:
    """Writes segments of one session with the calibration that applies to them.

    Returns what the file cannot express, one sentence each. Raises ValueError
    for segments of several sessions, because each session has its own clock and
    frame, and for times before zero, which MCAP does not support.
    """
    timed: list[_foxglove.Timed] = []
    sessions = set()
    # Neighbours share samples.
    readings: dict[str, set[int]] = {"/imu": set(), "/imu1": set()}
    names = []
    for segment in segments:
        sessions.add(segment.session)
        names.append(f"{segment.session}~{segment.index}")
        timed += _foxglove.sensors(calibration, segment.keyframes.t_ns[0])
        timed += _foxglove.keyframes(segment.keyframes)
        for topic, samples in ("/imu", segment.imu), ("/imu1", segment.imu1):
            timed += [
                reading
                for reading in _foxglove.imu(samples, topic)
                if reading[0] not in readings[topic]
            ]
            readings[topic].update(samples.t_ns)
        timed += _foxglove.landmarks(segment)
        timed += _foxglove.observations(segment)
    if len(sessions) != 1:
        raise ValueError(
            f"a file takes one session, not {len(sessions)}: each session has "
            "its own clock and frame"
        )
    timed.sort(key=lambda entry: entry[0])
    if timed[0][0] < 0:
        raise ValueError("times before zero cannot be written as MCAP")
    lost = _foxglove.losses(calibration)
    writer = Writer(output)
    for t_ns, topic, message in timed:
        writer.write_message(topic, message, log_time=t_ns, publish_time=t_ns)
    writer.add_metadata(
        "selfcal", {"segments": " ".join(names), "lost": "\n".join(lost)}
    )
    writer.finish()
    return lost


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m selfcal.mcap",
        description="Write segments of a rig as MCAP, one file per session.",
    )
    parser.add_argument("target", help="unix:/path or host:port, as in gRPC")
    parser.add_argument("rig")
    parser.add_argument(
        "folder", help="for the files SESSION.mcap; created if missing"
    )
    parser.add_argument(
        "segment", nargs="*", help="session~index; default: all"
    )
    parser.add_argument(
        "--version", default="active", help="version of the calibration"
    )
    parser.add_argument("--force", action="store_true", help="overwrite files")
    for flag in ("ca", "cert", "key"):
        parser.add_argument(
            f"--{flag}", help="PEM file for host:port, as for selfcal"
        )
    return parser


_Sessions = dict[str, list[segment_pb2.MotionSegment]]


def _fetch(
    flags: argparse.Namespace,
) -> tuple[v1.CalibrationParameters, _Sessions]:
    tls = Tls(flags.ca, flags.cert, flags.key) if flags.ca else None
    with connect(flags.target, tls) as daemon:
        calibration = daemon.calibration(flags.rig, flags.version).parameters
        names = flags.segment or [
            segment.name.rsplit("/", 1)[1]
            for segment in daemon.segments(flags.rig)
            if segment.has_data
        ]
        sessions: _Sessions = {}
        for name in names:
            data = daemon.segment_data(flags.rig, name)
            sessions.setdefault(data.session, []).append(data)
    return calibration, sessions


def main() -> int:
    flags = _parser().parse_args()
    os.makedirs(flags.folder, exist_ok=True)
    try:
        calibration, sessions = _fetch(flags)
    except grpc.RpcError as error:
        print(f"{flags.target}: {error.details()}", file=sys.stderr)
        return 3 if error.code() == grpc.StatusCode.UNAVAILABLE else 1
    for session, segments in sorted(sessions.items()):
        name = urllib.parse.quote(session, safe="") + ".mcap"
        path = os.path.join(flags.folder, name)
        if os.path.exists(path) and not flags.force:
            print(f"{path} exists: use --force to overwrite", file=sys.stderr)
            return 2
        segments.sort(key=lambda segment: segment.index)
        try:
            lost = write(f"{path}.new", segments, calibration)
            os.replace(f"{path}.new", path)
        except (OSError, ValueError) as error:
            pathlib.Path(f"{path}.new").unlink(missing_ok=True)
            print(f"{path} was not written: {error}", file=sys.stderr)
            return 2
        for line in lost:
            print(f"lost: {line}", file=sys.stderr)
        print(f"{path}\t{len(segments)} segments")
    return 0


if __name__ == "__main__":
    sys.exit(main())
