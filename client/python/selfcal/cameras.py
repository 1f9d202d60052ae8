"""The camera models of the contract, as in C++ (core/model/camera_models.h).

A model maps points in the camera's frame to the plane in which f and c scale
(to_plane), and back to rays of any length (to_ray); NaN where it has no result.
"""

from __future__ import annotations

import numpy as np

from selfcal.v1 import calibration_pb2 as v1

_MIN_DEPTH_RATIO = 1e-6


def _first_root(coefficients: list[float], limit: float) -> float:
    """Returns the first zero of 1 + c1 x + c2 x^2 + ... in (0, limit), or
    limit."""
    roots = np.roots([*coefficients[::-1], 1.0])
    real = roots[np.abs(roots.imag) < 1e-12 * np.abs(roots)].real
    return float(min([r for r in real if 0 < r < limit], default=limit))


def _scaled(u: np.ndarray, r: np.ndarray, r_new: np.ndarray) -> np.ndarray:
    """Scales u from its length r to the length r_new; r = 0 stays."""
    return u * np.where(r > 0, r_new / np.where(r > 0, r, 1), 0)[..., None]


class _Pinhole:
    """A camera that distorts u = (x/z, y/z)."""

    def to_plane(self, p_C: np.ndarray) -> np.ndarray:
        d = self.distort(p_C[..., :2] / p_C[..., 2:])
        depth = p_C[..., 2] / np.linalg.norm(p_C, axis=-1)
        return np.where((depth > _MIN_DEPTH_RATIO)[..., None], d, np.nan)

    def to_ray(self, d: np.ndarray) -> np.ndarray:
        u = self.undistort(d)
        return np.concatenate([u, np.ones_like(u[..., :1])], axis=-1)


class _Fov(_Pinhole):
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


class _Equidistant(_Pinhole):
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


class _RadialTangential(_Pinhole):
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


_MODELS = {
    v1.DISTORTION_MODEL_FOV: _Fov,
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL: _RadialTangential,
    v1.DISTORTION_MODEL_EQUIDISTANT: _Equidistant,
}


def model(camera: v1.CameraCalibration):
    """Returns the model of a camera, with its coefficients."""
    if camera.distortion_model not in _MODELS:
        raise ValueError(f"unknown distortion model {camera.distortion_model}")
    return _MODELS[camera.distortion_model](list(camera.distortion))
