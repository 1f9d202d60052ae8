"""Applies a calibration: corrects IMU readings, projects points to pixels, and
converts pixels to rays, as in C++ (core/model/imu.h, core/model/camera.h).

The last axis of an array has the components of a vector; there may be any
number of axes before it. Messages are those of the contract. Needs numpy. If
the camera model has no result, the row is NaN: for a point behind the camera or
where the distortion is not one-to-one, and for a pixel that no point projects
to. The borders of the image are ignored.
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

from selfcal.v1 import calibration_pb2 as v1

__all__ = ["correct_imu", "project", "unproject", "to_camera"]

_MIN_DEPTH_RATIO = 1e-6


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
) -> Tuple[np.ndarray, np.ndarray]:
    """Returns angular rate [rad/s] and specific force [m/s^2] in frame I."""
    T_g = _upper(imu.s_g, imu.m_g)
    T_a_R_AI = _upper(imu.s_a, imu.m_a) @ _rotation(imu.q_ai)
    return (
        (np.asarray(gyro) - b_g) @ np.linalg.inv(T_g).T,
        (np.asarray(accel) - b_a) @ np.linalg.inv(T_a_R_AI).T,
    )


def to_camera(camera: v1.CameraCalibration, p_I: np.ndarray) -> np.ndarray:
    """Transforms points from the body frame I to the camera's frame."""
    return np.asarray(p_I) @ _rotation(camera.q_ci).T + _vector(camera.p_ci)


def _first_root(coefficients: list[float], limit: float) -> float:
    """Returns the first zero of 1 + c1 x + c2 x^2 + ... in (0, limit), or
    limit."""
    roots = np.roots([*coefficients[::-1], 1.0])
    real = roots[np.abs(roots.imag) < 1e-12 * np.abs(roots)].real
    return float(min([r for r in real if 0 < r < limit], default=limit))


def _scaled(u: np.ndarray, r: np.ndarray, r_new: np.ndarray) -> np.ndarray:
    """Scales u from its length r to the length r_new; r = 0 stays."""
    return u * np.where(r > 0, r_new / np.where(r > 0, r, 1), 0)[..., None]


class _Fov:
    def __init__(self, k: list[float]) -> None:
        self._w = abs(k[0])

    def distort(self, u: np.ndarray) -> np.ndarray:
        if self._w == 0:
            return u
        r = np.linalg.norm(u, axis=-1)
        r_d = np.arctan(2 * r * np.tan(self._w / 2)) / self._w
        return _scaled(u, r, r_d)

    def undistort(self, d: np.ndarray) -> np.ndarray:
        if self._w == 0:
            return d
        r_d = np.linalg.norm(d, axis=-1)
        r = np.tan(r_d * self._w) / (2 * np.tan(self._w / 2))
        u = _scaled(d, r_d, r)
        u[r_d * self._w >= np.pi / 2] = np.nan
        return u


class _Equidistant:
    def __init__(self, k: list[float]) -> None:
        self._k = k
        slope = [(2 * i + 3) * c for i, c in enumerate(k)]
        self._max = np.sqrt(_first_root(slope, (np.pi / 2) ** 2))

    def _radius(self, theta: np.ndarray) -> np.ndarray:
        q = theta * theta
        return theta * np.polyval([*self._k[::-1], 1.0], q)

    def distort(self, u: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(u, axis=-1)
        theta = np.arctan(r)
        d = _scaled(u, r, self._radius(theta))
        d[theta >= self._max] = np.nan
        return d

    def undistort(self, d: np.ndarray) -> np.ndarray:
        r_d = np.linalg.norm(d, axis=-1)
        low, high = np.zeros_like(r_d), np.full_like(r_d, self._max)
        for _ in range(60):  # the radius increases with theta
            middle = (low + high) / 2
            below = self._radius(middle) < r_d
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        u = _scaled(d, r_d, np.tan((low + high) / 2))
        u[r_d >= self._radius(np.array(self._max))] = np.nan
        return u


class _RadialTangential:
    def __init__(self, k: list[float]) -> None:
        self._k = k
        self._max_r2 = _first_root([3 * k[0], 5 * k[1]], np.inf)

    def _value(self, u: np.ndarray) -> np.ndarray:
        k1, k2, p1, p2 = self._k
        x, y = u[..., 0], u[..., 1]
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
            ],
            axis=-1,
        )

    def _derivative(self, u: np.ndarray) -> np.ndarray:
        """Returns the derivative by u, which is symmetric: (xx, xy, yy)."""
        k1, k2, p1, p2 = self._k
        x, y = u[..., 0], u[..., 1]
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        slope = 2 * (k1 + 2 * k2 * r2)
        xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
        xy = slope * x * y + 2 * p1 * x + 2 * p2 * y
        yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
        return np.stack([xx, xy, yy], axis=-1)

    def _valid(self, u: np.ndarray) -> np.ndarray:
        xx, xy, yy = np.moveaxis(self._derivative(u), -1, 0)
        return (
            (np.sum(u * u, axis=-1) < self._max_r2)
            & (xx > 0)
            & (xx * yy - xy * xy > 0)
        )

    def distort(self, u: np.ndarray) -> np.ndarray:
        return np.where(self._valid(u)[..., None], self._value(u), np.nan)

    def undistort(self, d: np.ndarray) -> np.ndarray:
        """Runs Newton's method from the axis; halves steps that do not help."""
        u = np.zeros_like(d)
        for _ in range(60):
            error = d - self._value(u)
            xx, xy, yy = np.moveaxis(self._derivative(u), -1, 0)
            step = (
                np.stack(
                    [
                        yy * error[..., 0] - xy * error[..., 1],
                        xx * error[..., 1] - xy * error[..., 0],
                    ],
                    axis=-1,
                )
                / (xx * yy - xy * xy)[..., None]
            )
            size = np.linalg.norm(error, axis=-1)
            for _ in range(30):
                after = np.linalg.norm(d - self._value(u + step), axis=-1)
                bad = ~((after <= size) & self._valid(u + step))
                if not bad.any():
                    break
                step[bad] /= 2
            step[bad] = 0
            u = u + step
        missed = np.linalg.norm(d - self._value(u), axis=-1) > 1e-9
        u[missed] = np.nan
        return u


def _model(camera: v1.CameraCalibration):
    models = {
        v1.DISTORTION_MODEL_FOV: _Fov,
        v1.DISTORTION_MODEL_RADIAL_TANGENTIAL: _RadialTangential,
        v1.DISTORTION_MODEL_EQUIDISTANT: _Equidistant,
    }
    if camera.distortion_model not in models:
        raise ValueError(
            f"unknown distortion model {camera.distortion_model}"
        )
    return models[camera.distortion_model](list(camera.distortion))


def project(camera: v1.CameraCalibration, p_C: np.ndarray) -> np.ndarray:
    """Returns the pixels of points in the camera's frame (z forward)."""
    p = np.asarray(p_C, dtype=float)
    with np.errstate(all="ignore"):
        u = p[..., :2] / p[..., 2:]
        depth = p[..., 2] / np.linalg.norm(p, axis=-1)
        z_px = _model(camera).distort(u) * [camera.f.x, camera.f.y] + [
            camera.c.x,
            camera.c.y,
        ]
    return np.where((depth > _MIN_DEPTH_RATIO)[..., None], z_px, np.nan)


def unproject(camera: v1.CameraCalibration, z_px: np.ndarray) -> np.ndarray:
    """Returns the unit bearings of pixels, in the camera's frame."""
    d = (np.asarray(z_px, dtype=float) - [camera.c.x, camera.c.y]) / [
        camera.f.x,
        camera.f.y,
    ]
    with np.errstate(all="ignore"):
        u = _model(camera).undistort(d)
    ray = np.concatenate([u, np.ones_like(u[..., :1])], axis=-1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)
