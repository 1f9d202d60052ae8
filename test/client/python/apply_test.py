"""selfcal.apply makes of a calibration what the C++ library does.

apply_test.py PACKAGE_DIR WRITE_PREDICTIONS
"""

import subprocess
import sys
import unittest

PACKAGE, WRITE_PREDICTIONS = sys.argv[1:3]
sys.path.insert(0, PACKAGE)

import numpy as np

from selfcal import apply
from selfcal.v1 import calibration_pb2 as v1


def vector(values) -> v1.Vector3:
    return v1.Vector3(x=values[0], y=values[1], z=values[2])


def camera_of(model: str, values) -> v1.CameraCalibration:
    name = "DISTORTION_MODEL_" + model.upper().replace("-", "_")
    return v1.CameraCalibration(
        distortion_model=name,
        f=v1.Vector2(x=values[0], y=values[1]),
        c=v1.Vector2(x=values[2], y=values[3]),
        distortion=values[4:],
        q_ci=v1.Quaternion(w=1),
        p_ci=v1.Vector3(),
    )


class ApplyTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        lines = subprocess.run(
            [WRITE_PREDICTIONS], check=True, stdout=subprocess.PIPE, text=True
        ).stdout.splitlines()
        cls.imus = []
        cls.cameras = []  # with what it projects and what it unprojects
        for line in lines:
            what, *texts = line.split()
            model = texts.pop(0) if what == "camera" else ""
            values = [float(text) for text in texts]
            if what == "imu":
                cls.imus.append(values)
            elif what == "camera":
                cls.cameras.append(
                    (camera_of(model, values), {"project": [], "unproject": []})
                )
            else:
                cls.cameras[-1][1][what].append(values)

    def test_corrects_readings(self) -> None:
        self.assertEqual(len(self.imus), 40)
        for values in self.imus:
            parts = [np.array(values[i : i + 3]) for i in range(0, 12, 3)]
            w, x, y, z = values[12:16]
            imu = v1.ImuCalibration(
                s_g=vector(parts[0]),
                m_g=vector(parts[1]),
                s_a=vector(parts[2]),
                m_a=vector(parts[3]),
                q_ai=v1.Quaternion(w=w, x=x, y=y, z=z),
            )
            optional = values[37:]
            if len(optional) in (12, 18):
                imu.gyro_g_sensitivity.extend(optional[:9])
                optional = optional[9:]
            imu.accel_position.extend(optional)
            rest = np.array(values[16:37]).reshape(7, 3)
            w_I, f_I = apply.correct_imu(imu, *rest[:5])
            np.testing.assert_allclose(w_I, rest[5], atol=1e-12)
            np.testing.assert_allclose(f_I, rest[6], atol=1e-11)
            # Many at once.
            w_I, f_I = apply.correct_imu(
                imu, np.tile(rest[0], (4, 1)), *rest[1:4], dw_I=rest[4]
            )
            np.testing.assert_allclose(w_I, np.tile(rest[5], (4, 1)))
            np.testing.assert_allclose(
                np.broadcast_to(f_I, (4, 3)),
                np.tile(rest[6], (4, 1)),
                atol=1e-11,
            )

    def test_projects(self) -> None:
        seen = 0
        for camera, predictions in self.cameras:
            rows = np.array(predictions["project"])
            z_px = apply.project(camera, rows[:, :3])
            expected = np.where(rows[:, 3:4] > 0, rows[:, 4:], np.nan)
            np.testing.assert_allclose(z_px, expected, rtol=1e-9, atol=1e-7)
            seen += int(rows[:, 3].sum())
            one = apply.project(camera, rows[0, :3])
            np.testing.assert_allclose(one, expected[0], atol=1e-9)
        self.assertGreater(seen, 500)

    def test_unprojects(self) -> None:
        seen = 0
        for camera, predictions in self.cameras:
            rows = np.array(predictions["unproject"])
            bearing_C = apply.unproject(camera, rows[:, :2])
            expected = np.where(rows[:, 2:3] > 0, rows[:, 3:], np.nan)
            np.testing.assert_allclose(bearing_C, expected, atol=1e-7)
            seen += int(rows[:, 2].sum())
            one = apply.unproject(camera, rows[0, :2])
            np.testing.assert_allclose(one, expected[0], atol=1e-9)
        self.assertGreater(seen, 1000)

    def test_moves_points_to_the_camera(self) -> None:
        camera = v1.CameraCalibration(
            q_ci=v1.Quaternion(w=0.5, x=0.5, y=0.5, z=0.5),
            p_ci=v1.Vector3(x=1, y=2, z=3),
        )
        # The rotation takes x to y, y to z, z to x.
        np.testing.assert_allclose(
            apply.to_camera(camera, np.eye(3)),
            [[1, 3, 3], [1, 2, 4], [2, 2, 3]],
            atol=1e-15,
        )

    def test_an_unknown_model_is_an_error(self) -> None:
        with self.assertRaises(ValueError):
            apply.project(v1.CameraCalibration(), np.ones(3))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
