"""Segments of a simulated device, written as MCAP and read back with the
schemas that stand in the file.

    mcap_test.py PACKAGE_DIR EXTRA_DIR SELFCALD SELFCAL_DEMO
"""

import io
import os
import pathlib
import resource
import subprocess
import sys
import unittest

PACKAGE, EXTRA, SELFCALD, DEMO = sys.argv[1:5]
sys.path[:0] = [PACKAGE, EXTRA]

import numpy as np
from demo_device import DemoDevice, run_module
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import selfcal
from selfcal import apply, mcap
from selfcal.v1 import (
    calibration_pb2 as v1,
    segment_pb2,
)


def read(file) -> dict:
    """The messages of each topic, as (schema's name, time, message)."""
    topics: dict = {}
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        topics.setdefault(channel.topic, []).append(
            (schema.name, message.log_time, decoded)
        )
    return topics


def stamp_ns(message) -> int:
    return message.timestamp.seconds * 10**9 + message.timestamp.nanos


def xyz(v) -> list:
    return [v.x, v.y, v.z]


def matrix(q) -> np.ndarray:
    """R_AB of q_AB, by Rodrigues' formula."""
    x = np.array([[0, -q.z, q.y], [q.z, 0, -q.x], [-q.y, q.x, 0]])
    return np.eye(3) + 2 * (q.w * x + x @ x)


def run(arguments: list, **options) -> subprocess.CompletedProcess:
    return run_module("selfcal.mcap", [PACKAGE, EXTRA], arguments, **options)


class McapTest(DemoDevice):
    selfcald = SELFCALD
    demo = DEMO

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        done = run([cls.target, "simulated", f"{cls.folder}/out"])
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        with selfcal.connect(cls.target) as connection:
            cls.calibration = connection.calibration("simulated").parameters
            cls.segments = sorted(
                (
                    connection.segment_data(
                        "simulated", segment.name.rsplit("/", 1)[1]
                    )
                    for segment in connection.segments("simulated")
                    if segment.has_data
                ),
                key=lambda segment: segment.index,
            )
        with open(f"{cls.folder}/out/walk.mcap", "rb") as file:
            cls.topics = read(file)

    def test_every_message_is_where_and_when_it_belongs(self) -> None:
        schemas = {
            "/tf": "foxglove.FrameTransform",
            "/keyframes": "foxglove.PoseInFrame",
            "/motion": "selfcal.mcap.KeyframeMotion",
            "/imu": "selfcal.mcap.ImuReading",
            "/landmarks": "foxglove.PointCloud",
            "/cam0/calibration": "foxglove.CameraCalibration",
            "/cam0/observations": "foxglove.ImageAnnotations",
        }
        self.assertGreater(len(self.segments), 3)
        self.assertEqual(set(self.topics), set(schemas))
        for topic, entries in self.topics.items():
            for schema, t_ns, message in entries:
                self.assertEqual(schema, schemas[topic])
                self.assertEqual(t_ns, stamp_ns(message))

    def test_keyframes_are_as_they_were_sent(self) -> None:
        columns = [segment.keyframes for segment in self.segments]
        times = [t for column in columns for t in column.t_ns]
        poses = self.topics["/keyframes"]
        motions = self.topics["/motion"]
        bodies = [
            m for _, _, m in self.topics["/tf"] if m.child_frame_id == "I"
        ]
        self.assertEqual([t for _, t, _ in poses], times)
        sent = {
            name: np.array(
                [value for column in columns for value in getattr(column, name)]
            ).reshape(len(times), -1)
            for name in ("q_gi", "p_gi", "v_gi", "b_a", "b_g")
        }
        for k, ((_, _, pose), (_, _, motion), body) in enumerate(
            zip(poses, motions, bodies, strict=True)
        ):
            self.assertEqual((pose.frame_id, body.parent_frame_id), ("G", "G"))
            for p in (pose.pose.position, body.translation):
                self.assertEqual(xyz(p), list(sent["p_gi"][k]))
            for q in (pose.pose.orientation, body.rotation):
                self.assertEqual([q.w, *xyz(q)], list(sent["q_gi"][k]))
            for name in ("v_gi", "b_a", "b_g"):
                self.assertEqual(
                    xyz(getattr(motion, name)), list(sent[name][k])
                )

    def test_readings_are_as_they_were_sent_and_none_twice(self) -> None:
        sent = {}
        for segment in self.segments:
            imu = segment.imu
            for i, t_ns in enumerate(imu.t_ns):
                sent[t_ns] = list(imu.gyro[3 * i : 3 * i + 3]) + list(
                    imu.accel[3 * i : 3 * i + 3]
                )
        got = {t: xyz(m.gyro) + xyz(m.accel) for _, t, m in self.topics["/imu"]}
        self.assertEqual(got, sent)
        self.assertEqual(len(self.topics["/imu"]), len(sent))

    def landmarks(self, cloud) -> dict:
        """Places by id."""
        self.assertEqual(cloud.frame_id, "G")
        numbers = {7: "f4", 8: "f8", 5: "u4"}  # PackedElementField.NumericType
        layout = np.dtype(
            {
                "names": [field.name for field in cloud.fields],
                "formats": [numbers[field.type] for field in cloud.fields],
                "offsets": [field.offset for field in cloud.fields],
                "itemsize": cloud.point_stride,
            }
        )
        return {
            int(point["id_high"]) << 32 | int(point["id_low"]): [
                float(point[name]) for name in "xyz"
            ]
            for point in np.frombuffer(cloud.data, layout)
        }

    def test_landmarks_and_observations_are_as_they_were_sent(self) -> None:
        seen = {}
        for segment in self.segments:
            observations = segment.observations
            for i, keyframe in enumerate(observations.keyframe):
                id = segment.landmarks.id[observations.landmark[i]]
                seen[segment.keyframes.t_ns[keyframe], id] = list(
                    observations.z_px[2 * i : 2 * i + 2]
                )
        got = {}
        for _, t_ns, message in self.topics["/cam0/observations"]:
            (points,) = message.points
            (pair,) = points.metadata
            ids = map(int, pair.value.split(","))
            for id, point in zip(ids, points.points, strict=True):
                got[t_ns, id] = [point.x, point.y]
        self.assertEqual(got, seen)
        clouds = self.topics["/landmarks"]
        for (_, t_ns, cloud), segment in zip(
            clouds, self.segments, strict=True
        ):
            self.assertEqual(t_ns, segment.keyframes.t_ns[0])
            places = np.array(segment.landmarks.p_g).reshape(-1, 3)
            self.assertEqual(
                self.landmarks(cloud),
                dict(zip(segment.landmarks.id, places.tolist(), strict=True)),
            )

    def test_frames_lead_from_a_landmark_to_its_pixel(self) -> None:
        """With the calibration that the SLAM system had."""
        folder = f"{self.folder}/factory"
        done = run([self.target, "simulated", folder, "--version", "1"])
        self.assertEqual(done.returncode, 0)
        with open(f"{folder}/walk.mcap", "rb") as file:
            topics = read(file)
        with selfcal.connect(self.target) as connection:
            factory = connection.calibration("simulated", "1").parameters
        camera = factory.cameras[0]
        frames = {}
        for _, t_ns, message in topics["/tf"]:
            frames[t_ns, message.child_frame_id] = (
                matrix(message.rotation),
                np.array(xyz(message.translation)),
            )
        R_IC, p_IC = frames[topics["/landmarks"][0][1], "cam0"]
        places: dict = {}
        for _, _, cloud in topics["/landmarks"]:
            places.update(self.landmarks(cloud))
        errors = []
        for _, t_ns, message in topics["/cam0/observations"]:
            R_GI, p_GI = frames[t_ns, "I"]
            ids = message.points[0].metadata[0].value.split(",")
            p_I = (np.array([places[int(id)] for id in ids]) - p_GI) @ R_GI
            p_C = (p_I - p_IC) @ R_IC
            np.testing.assert_allclose(
                p_C, apply.to_camera(camera, p_I), atol=1e-12
            )
            z_px = [[point.x, point.y] for point in message.points[0].points]
            error = apply.project(camera, p_C) - z_px
            errors += list(np.linalg.norm(error, axis=-1))
        self.assertGreater(len(errors), 1000)
        self.assertLess(np.nanmedian(errors), 3)  # of tracks with noise

    def test_says_what_the_schema_cannot(self) -> None:
        done = run([self.target, "simulated", f"{self.folder}/again"])
        self.assertIn("lost: cam0: Foxglove's schema does not", done.stderr)
        self.assertIn(
            "lost: imu: s_g, m_g, s_a, m_a are not included", done.stderr
        )
        _, _, camera = self.topics["/cam0/calibration"][0]
        sent = self.calibration.cameras[0]
        self.assertEqual(camera.distortion_model, "fov")
        self.assertEqual(list(camera.D), list(sent.distortion))
        self.assertEqual(
            list(camera.K),
            [sent.f.x, 0, sent.c.x, 0, sent.f.y, sent.c.y, 0, 0, 1],
        )

    def test_models_that_foxglove_knows_lose_nothing(self) -> None:
        calibration = v1.CalibrationParameters()
        calibration.CopyFrom(self.calibration)
        for vector, nominal in (("s_g", 1), ("s_a", 1), ("m_g", 0), ("m_a", 0)):
            for axis in "xyz":
                setattr(getattr(calibration.imu, vector), axis, nominal)
        known = {
            v1.DISTORTION_MODEL_RADIAL_TANGENTIAL: (
                "plumb_bob",
                [1, 2, 3, 4, 0],
            ),
            v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_5: (
                "plumb_bob",
                [1, 2, 3, 4, 5],
            ),
            v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_8: (
                "rational_polynomial",
                [1, 2, 3, 4, 5, 6, 7, 8],
            ),
            v1.DISTORTION_MODEL_EQUIDISTANT: ("kannala_brandt", [1, 2, 3, 4]),
        }
        for model, (name, coefficients) in known.items():
            calibration.cameras[0].distortion_model = model
            calibration.cameras[0].distortion[:] = (
                [1, 2, 3, 4]
                if model == v1.DISTORTION_MODEL_RADIAL_TANGENTIAL
                else coefficients
            )
            file = io.BytesIO()
            self.assertEqual(
                mcap.write(file, self.segments[:1], calibration), []
            )
            file.seek(0)
            _, _, camera = read(file)["/cam0/calibration"][0]
            self.assertEqual(camera.distortion_model, name)
            self.assertEqual(list(camera.D), coefficients)

    def test_a_second_imu_has_its_frames_and_readings(self) -> None:
        calibration = v1.CalibrationParameters()
        calibration.CopyFrom(self.calibration)
        second = calibration.imu1
        for vector in (second.s_g, second.s_a):
            vector.x = vector.y = vector.z = 1
        second.m_a.y = 0.01
        second.q_ai.w = 1
        # J is turned by 90 degrees about x: y of I is z of J.
        second.q_ji.w, second.q_ji.x = np.sqrt(0.5), np.sqrt(0.5)
        second.p_ji.x, second.p_ji.z = 0.1, 0.02
        second.time_offset_s = 0.003
        segments = []
        sent = {}
        for segment in self.segments:
            segments.append(segment_pb2.MotionSegment())
            segments[-1].CopyFrom(segment)
            samples = segments[-1].imu1
            samples.t_ns.extend(t + 1000 for t in segment.imu.t_ns)
            samples.gyro.extend(2 * v for v in segment.imu.gyro)
            samples.accel.extend(3 * v for v in segment.imu.accel)
            for i, t_ns in enumerate(samples.t_ns):
                sent[t_ns] = list(samples.gyro[3 * i : 3 * i + 3]) + list(
                    samples.accel[3 * i : 3 * i + 3]
                )
        file = io.BytesIO()
        lost = mcap.write(file, segments, calibration)
        self.assertIn("imu1: m_a is not included; readings are raw", lost)
        self.assertIn(
            "imu1: the time offset of 0.003 s is not included; readings keep "
            "their own timestamps",
            lost,
        )
        file.seek(0)
        topics = read(file)
        self.assertEqual(len(topics["/imu"]), len(self.topics["/imu"]))
        got = {t: xyz(m.gyro) + xyz(m.accel) for _, t, m in topics["/imu1"]}
        self.assertEqual(got, sent)
        self.assertEqual(len(topics["/imu1"]), len(sent))
        frames = {m.child_frame_id: m for _, _, m in topics["/tf"]}
        self.assertEqual(frames["J"].parent_frame_id, "I")
        self.assertEqual(frames["A1"].parent_frame_id, "J")
        # T_JI takes J's place in I to the origin of J.
        place = np.array(xyz(frames["J"].translation))
        np.testing.assert_allclose(
            matrix(second.q_ji) @ place + xyz(second.p_ji), 0, atol=1e-15
        )
        np.testing.assert_allclose(
            matrix(frames["J"].rotation) @ [0, 0, 1], [0, 1, 0], atol=1e-15
        )

    def test_refuses_what_one_file_cannot_hold(self) -> None:
        other = segment_pb2.MotionSegment()
        other.CopyFrom(self.segments[0])
        other.session = "other"
        with self.assertRaisesRegex(ValueError, "a file takes one session"):
            mcap.write(
                io.BytesIO(), [self.segments[0], other], self.calibration
            )
        other.keyframes.t_ns[0] = -5
        with self.assertRaisesRegex(ValueError, "times before zero"):
            mcap.write(io.BytesIO(), [other], self.calibration)

    def test_leaves_a_file_that_is_there(self) -> None:
        arguments = [self.target, "simulated", f"{self.folder}/out"]
        done = run(arguments)
        self.assertEqual(done.returncode, 2)
        self.assertIn("exists", done.stderr)
        self.assertEqual(run([*arguments, "--force"]).returncode, 0)

    def test_leaves_the_old_file_when_the_disk_is_full(self) -> None:
        folder = f"{self.folder}/full"
        self.assertEqual(run([self.target, "simulated", folder]).returncode, 0)
        before = pathlib.Path(f"{folder}/walk.mcap").read_bytes()
        done = run(
            [self.target, "simulated", folder, "--force"],
            preexec_fn=lambda: resource.setrlimit(
                resource.RLIMIT_FSIZE, (4096, 4096)
            ),
        )
        self.assertEqual(done.returncode, 2)
        self.assertIn("walk.mcap was not written", done.stderr)
        self.assertEqual(os.listdir(folder), ["walk.mcap"])
        after = pathlib.Path(f"{folder}/walk.mcap").read_bytes()
        self.assertEqual(after, before)

    def test_says_what_the_daemon_does_not_have(self) -> None:
        done = run([self.target, "unknown", f"{self.folder}/none"])
        self.assertEqual(done.returncode, 1)
        self.assertIn("rig unknown does not exist", done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1)
        gone = f"unix:{self.folder}/gone.sock"
        done = run([gone, "simulated", f"{self.folder}/none"])
        self.assertEqual(done.returncode, 3)
        self.assertEqual(len(done.stderr.splitlines()), 1)

    def test_says_which_extra_is_missing(self) -> None:
        done = subprocess.run(
            [sys.executable, "-c", "import selfcal.mcap"],
            env={**os.environ, "PYTHONPATH": PACKAGE},
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("pip install 'selfcal[mcap]'", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
