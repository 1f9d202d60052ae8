"""Applies a calibration: corrects IMU readings, projects points to pixels, and
converts pixels to rays, as in C++ (core/model/imu.h, core/model/camera.h).

The last axis of an array has the components of a vector; there may be any
number of axes before it. Messages are those of the contract. Needs numpy. If
the camera model has no result, the row is NaN: for a point where it is not
one-to-one (a pinhole: also behind the camera), and for a pixel that no point
projects to. The borders of the image are ignored.
"""

from __future__ import annotations

import numpy as np

from selfcal import cameras
from selfcal.v1 import calibration_pb2 as v1

__all__ = ["correct_imu", "project", "unproject", "to_camera"]


def _vector(v) -> np.ndarray:
    return np.array([v.x, v.y, v.z])


def _rotation(q: v1.Quaternion) -> np.ndarray:
    """Returns the matrix R_AB of q_AB."""
    w, x, y, z = np.array([q.w, q.x, q.y, q.z]) / np.linalg.norm(
        [q.w, q.x, q.y, q.z]
    )
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _upper(s: v1.Vector3, m: v1.Vector3) -> np.ndarray:
    return np.array([[s.x, m.x, m.y], [0, s.y, m.z], [0, 0, s.z]])


def correct_imu(
    imu: v1.ImuCalibration,
    gyro: np.ndarray,
    accel: np.ndarray,
    b_g: np.ndarray,
    b_a: np.ndarray,
    dw_I: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Returns angular rate [rad/s] and specific force [m/s^2] in frame I.

    The angular acceleration dw_I [rad/s^2], zero unless given, matters only to
    a calibration with a position of the accelerometer.
    """
    T_g = _upper(imu.s_g, imu.m_g)
    M = _upper(imu.s_a, imu.m_a) @ _rotation(imu.q_ai)
    force_by_accel = np.linalg.inv(M)
    f_I = (np.asarray(accel) - b_a) @ force_by_accel.T
    rate = np.asarray(gyro) - b_g
    if imu.gyro_g_sensitivity:
        rate = rate - f_I @ np.reshape(imu.gyro_g_sensitivity, (3, 3)).T
    w_I = rate @ np.linalg.inv(T_g).T
    if imu.accel_position:
        # One position of each axis, or of all.
        r = np.reshape(imu.accel_position, (-1, 3)) * np.ones((3, 1))
        force = np.cross(w_I[..., None, :], np.cross(w_I[..., None, :], r))
        if dw_I is not None:
            force = force + np.cross(np.asarray(dw_I)[..., None, :], r)
        f_I = f_I - np.sum(force * M, axis=-1) @ force_by_accel.T
    return w_I, f_I


def to_camera(camera: v1.CameraCalibration, p_I: np.ndarray) -> np.ndarray:
    """Transforms points from the body frame I to the camera's frame."""
    return np.asarray(p_I) @ _rotation(camera.q_ci).T + _vector(camera.p_ci)


def project(camera: v1.CameraCalibration, p_C: np.ndarray) -> np.ndarray:
    """Returns the pixels of points in the camera's frame (z forward)."""
    with np.errstate(all="ignore"):
        d = cameras.model(camera).to_plane(np.asarray(p_C, dtype=float))
    return d * [camera.f.x, camera.f.y] + [camera.c.x, camera.c.y]


def unproject(camera: v1.CameraCalibration, z_px: np.ndarray) -> np.ndarray:
    """Returns the unit bearings of pixels, in the camera's frame."""
    d = (np.asarray(z_px, dtype=float) - [camera.c.x, camera.c.y]) / [
        camera.f.x,
        camera.f.y,
    ]
    with np.errstate(all="ignore"):
        ray = cameras.model(camera).to_ray(d)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)
