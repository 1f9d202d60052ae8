"""The Python package and its example against a real daemon.

python_test.py PACKAGE_DIR EXAMPLE SELFCALD
"""

import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

PACKAGE, EXAMPLE, SELFCALD = sys.argv[1:4]
sys.path[:0] = [
    PACKAGE,
    os.path.dirname(EXAMPLE),
    str(pathlib.Path(__file__).parents[1]),
]

import grpc
import history
from device import RIG
from google.protobuf import json_format
from running_daemon import RunningDaemon

import selfcal
from selfcal.v1 import rig_pb2, segment_pb2, store_service_pb2

KEYFRAMES = 12


def segment_at_rest(index: int) -> segment_pb2.StreamSegmentsRequest:
    """A device that lies still and sees nothing."""
    request = segment_pb2.StreamSegmentsRequest(parent="rigs/tablet")
    segment = request.segment
    segment.session = "rest"
    segment.index = index
    if index > 0:
        segment.temperature_c = 20.5 * index
    begin_ns = index * 10**10
    for k in range(KEYFRAMES):
        segment.keyframes.t_ns.append(begin_ns + k * 10**8)
        segment.keyframes.q_gi.extend([1, 0, 0, 0])
        for column in ("p_gi", "v_gi", "b_a", "b_g"):
            getattr(segment.keyframes, column).extend([0, 0, 0])
    for i in range((KEYFRAMES - 1) * 20 + 1):
        segment.imu.t_ns.append(begin_ns + i * 5 * 10**6)
        segment.imu.gyro.extend([0, 0, 0])
        segment.imu.accel.extend([0, 0, 9.81])
    return request


class PythonTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        running = RunningDaemon(SELFCALD, f"{self.folder}/state")
        self.addCleanup(running.stop)
        self.target = running.target
        self.daemon = selfcal.connect(self.target)
        self.addCleanup(self.daemon.close)
        self.daemon.rig_service.CreateRig(
            rig_pb2.CreateRigRequest(
                rig=json_format.ParseDict(
                    {"name": "rigs/tablet", **RIG}, rig_pb2.Rig()
                )
            )
        )

    def test_lists_what_was_streamed(self) -> None:
        stored = segment_pb2.StreamSegmentsResponse.STORED
        verdicts = [
            answer.verdict
            for answer in self.daemon.stream(map(segment_at_rest, range(3)))
        ]
        self.assertEqual(verdicts, [stored] * 3)
        (rig,) = self.daemon.activity().rigs
        self.assertEqual((rig.name, rig.traffic.stored), ("rigs/tablet", 3))
        frame = history.segment_frame(self.daemon, "tablet")
        self.assertEqual(list(frame.segment), ["rest~0", "rest~1", "rest~2"])
        self.assertEqual(list(frame.keyframes), [KEYFRAMES] * 3)
        self.assertAlmostEqual(frame.seconds[0], 1.1)
        self.assertTrue(math.isnan(frame.temperature_c[0]))
        self.assertEqual(list(frame.temperature_c[1:]), [20.5, 41])

    def test_reads_sessions_and_what_a_segment_tells(self) -> None:
        list(self.daemon.stream(map(segment_at_rest, range(2))))
        (session,) = self.daemon.sessions("tablet")
        self.assertEqual((session.session, session.segments), ("rest", 2))
        path = list(self.daemon.trajectory("tablet", "rest"))
        self.assertEqual(
            [piece.segment for piece in path],
            [f"rigs/tablet/segments/rest~{k}" for k in range(2)],
        )
        residuals = self.daemon.segment_residuals("tablet", "rest~0")
        self.assertEqual(residuals.calibration_version, 1)
        self.assertEqual(len(residuals.intervals.whitened) % 15, 0)
        self.daemon.segment_information("tablet", "rest~0")
        kinds = [event.kind for event in self.daemon.events("tablet")]
        self.assertIn(store_service_pb2.Event.RIG_CREATED, kinds)

    def test_plots_the_history(self) -> None:
        frame = history.calibration_frame(self.daemon, "tablet")
        self.assertEqual(set(frame.version), {1})
        focal = frame[frame.component == "cam0.focal.x"].iloc[0]
        self.assertEqual((focal.value, focal.unit), (260, "px"))
        plot = f"{self.folder}/plot.png"
        done = subprocess.run(
            [sys.executable, EXAMPLE, self.target, "tablet", plot],
            env={**os.environ, "PYTHONPATH": PACKAGE},
            check=False,
        )
        self.assertEqual(done.returncode, 0)
        with open(plot, "rb") as file:
            self.assertEqual(file.read(4), b"\x89PNG")

    def test_reads_rigs_tables_runs_and_the_active_version(self) -> None:
        self.assertEqual([r.name for r in self.daemon.rigs()], ["rigs/tablet"])
        self.assertEqual(len(self.daemon.tables("tablet")), 3)
        self.assertEqual(list(self.daemon.recalibrations("tablet")), [])
        failed = self.daemon.recalibrations(
            filter="state = FAILED", order_by="duration asc"
        )
        self.assertEqual(list(failed), [])
        for verdict, versions in (("FACTORY", [1]), ("GOOD", [])):
            found = self.daemon.calibrations(
                filter=f"verdict = {verdict}", order_by="create_time asc"
            )
            self.assertEqual([one.version for one in found], versions)
        self.assertEqual(self.daemon.calibration("tablet").version, 1)
        watch = self.daemon.watch_calibration("tablet")
        self.assertEqual(next(watch).version, 1)
        watch.cancel()

    def test_says_what_the_daemon_says(self) -> None:
        with self.assertRaises(grpc.RpcError) as raised:
            list(self.daemon.segments("unknown"))
        self.assertEqual(raised.exception.code(), grpc.StatusCode.NOT_FOUND)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
