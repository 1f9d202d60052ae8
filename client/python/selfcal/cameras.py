"""The camera models of the contract, as in C++ (core/model/camera_models.h).

A model maps points in the camera's frame to the plane in which f and c scale
(to_plane), and back to rays of any length (to_ray); NaN where it has no result.
"""

from __future__ import annotations

import numpy as np

from selfcal.v1 import calibration_pb2 as v1

_MIN_DEPTH_RATIO = 1e-6
_MIN_AXIAL_RATIO = 1e-6
_MAX_ANGLE = 2 * np.arctan(2000)


def _first_root(coefficients: list[float], limit: float) -> float:
    """Returns the first zero of 1 + c1 x + c2 x^2 + ... in (0, limit), or
    limit."""
    roots = np.roots([*coefficients[::-1], 1.0])
    real = roots[np.abs(roots.imag) < 1e-12 * np.abs(roots)].real
    return float(min([r for r in real if 0 < r < limit], default=limit))


def _scaled(u: np.ndarray, r: np.ndarray, r_new: np.ndarray) -> np.ndarray:
    """Scales u from its length r to the length r_new; r = 0 stays."""
    return u * np.where(r > 0, r_new / np.where(r > 0, r, 1), 0)[..., None]


def _ray(xy: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.concatenate([xy, z[..., None]], axis=-1)


class _Pinhole:
    """A camera that distorts u = (x/z, y/z)."""

    def to_plane(self, p_C: np.ndarray) -> np.ndarray:
        d = self.distort(p_C[..., :2] / p_C[..., 2:])
        depth = p_C[..., 2] / np.linalg.norm(p_C, axis=-1)
        return np.where((depth > _MIN_DEPTH_RATIO)[..., None], d, np.nan)

    def to_ray(self, d: np.ndarray) -> np.ndarray:
        u = self.undistort(d)
        return _ray(u, np.ones_like(u[..., 0]))


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


class _Equidistant:
    """Kannala and Brandt, beyond 90 degrees."""

    def __init__(self, k: list[float]) -> None:
        self._k = k
        slope = [(2 * i + 3) * c for i, c in enumerate(k)]
        self._max = np.sqrt(_first_root(slope, _MAX_ANGLE**2))

    def _radius(self, theta: np.ndarray) -> np.ndarray:
        q = theta * theta
        return theta * np.polyval([*self._k[::-1], 1.0], q)

    def to_plane(self, p_C: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(p_C[..., :2], axis=-1)
        theta = np.arctan2(r, p_C[..., 2])
        d = _scaled(p_C[..., :2], r, self._radius(theta))
        d[theta >= self._max] = np.nan
        return d

    def to_ray(self, d: np.ndarray) -> np.ndarray:
        r_d = np.linalg.norm(d, axis=-1)
        low, high = np.zeros_like(r_d), np.full_like(r_d, self._max)
        for _ in range(60):  # the radius increases with theta
            middle = (low + high) / 2
            below = self._radius(middle) < r_d
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        inside = r_d < self._radius(np.array(self._max))
        theta = np.where(inside, (low + high) / 2, np.nan)
        return _ray(_scaled(d, r_d, np.sin(theta)), np.cos(theta))


class _RadialTangential(_Pinhole):
    """k1 k2 p1 p2, with k3, or with k3 .. k6 in a denominator."""

    def __init__(self, k: list[float]) -> None:
        k1, k2, self._p1, self._p2, k3, k4, k5, k6 = k + [0.0] * (8 - len(k))
        # Polynomials in r^2, lowest power first.
        self._above = np.polynomial.Polynomial([1, k1, k2, k3])
        self._below = np.polynomial.Polynomial([1, k4, k5, k6])
        # The slope of the radial profile is this, over the square of _below.
        slope = self._above * self._below + np.polynomial.Polynomial([0, 2]) * (
            self._above.deriv() * self._below
            - self._above * self._below.deriv()
        )
        self._max_r2 = min(
            _first_root(list(slope.coef[1:]), np.inf),
            _first_root([k4, k5, k6], np.inf),
        )

    def _value(self, u: np.ndarray) -> np.ndarray:
        p1, p2 = self._p1, self._p2
        x, y = u[..., 0], u[..., 1]
        r2 = x * x + y * y
        radial = self._above(r2) / self._below(r2)
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
            ],
            axis=-1,
        )

    def _derivative(self, u: np.ndarray) -> np.ndarray:
        """Returns the derivative by u, which is symmetric: (xx, xy, yy)."""
        p1, p2 = self._p1, self._p2
        x, y = u[..., 0], u[..., 1]
        r2 = x * x + y * y
        below = self._below(r2)
        radial = self._above(r2) / below
        by_r2 = self._above.deriv()(r2) - radial * self._below.deriv()(r2)
        slope = 2 * by_r2 / below
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


class _Axial:
    """A camera with d = (X, Y) / w. A subclass has `_distance`, which returns w
    and whether the model is one-to-one, and `_ray` without regard to that."""

    def to_plane(self, p_C: np.ndarray) -> np.ndarray:
        w, valid = self._distance(p_C)
        return np.where(valid[..., None], p_C[..., :2] / w[..., None], np.nan)

    def to_ray(self, d: np.ndarray) -> np.ndarray:
        ray = self._ray(d)
        _, valid = self._distance(ray)
        return np.where(valid[..., None], ray, np.nan)


def _sphere(
    r2: np.ndarray, z: np.ndarray, xi: float, one: float
) -> tuple[np.ndarray, np.ndarray]:
    """Returns xi D + one z for D = sqrt(r2 + z^2), and whether the quotient by
    it is one-to-one."""
    length = np.sqrt(r2 + z * z)
    w = xi * length + one * z
    valid = (w >= _MIN_AXIAL_RATIO * length) & (one * length + xi * z > 0)
    return w, valid


class _Unified(_Axial):
    def __init__(self, k: list[float]) -> None:
        self._xi = k[0]
        self._plane = _RadialTangential(k[1:])

    def _distance(self, p_C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r2 = np.sum(p_C[..., :2] ** 2, axis=-1)
        return _sphere(r2, p_C[..., 2], self._xi, 1)

    def to_plane(self, p_C: np.ndarray) -> np.ndarray:
        return self._plane.distort(super().to_plane(p_C))

    def _ray(self, d: np.ndarray) -> np.ndarray:
        xi = self._xi
        u = self._plane.undistort(d)
        q = np.sum(u * u, axis=-1)
        s = np.sqrt(1 + (1 - xi * xi) * q)
        return _ray((xi + s)[..., None] * u, s - xi * q)


def _ellipsoid_ray(
    d: np.ndarray, alpha: float, beta: float
) -> tuple[np.ndarray, np.ndarray]:
    q = beta * np.sum(d * d, axis=-1)
    s = np.sqrt(1 + (1 - 2 * alpha) * q)
    return (alpha + (1 - alpha) * s)[..., None] * d, s - alpha * (1 - alpha) * q


class _ExtendedUnified(_Axial):
    def __init__(self, k: list[float]) -> None:
        self._alpha, self._beta = k

    def _distance(self, p_C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r2 = self._beta * np.sum(p_C[..., :2] ** 2, axis=-1)
        return _sphere(r2, p_C[..., 2], self._alpha, 1 - self._alpha)

    def _ray(self, d: np.ndarray) -> np.ndarray:
        return _ray(*_ellipsoid_ray(d, self._alpha, self._beta))


class _DoubleSphere(_Axial):
    def __init__(self, k: list[float]) -> None:
        self._xi, self._alpha = k

    def _distance(self, p_C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r2 = np.sum(p_C[..., :2] ** 2, axis=-1)
        shifted = p_C[..., 2] + self._xi * np.linalg.norm(p_C, axis=-1)
        w, valid = _sphere(r2, shifted, self._alpha, 1 - self._alpha)
        return w, valid & (abs(self._xi) < 1)

    def _ray(self, d: np.ndarray) -> np.ndarray:
        xi = self._xi
        m, n = _ellipsoid_ray(d, self._alpha, 1)
        m2 = np.sum(m * m, axis=-1)
        t = xi * n + np.sqrt(n * n + (1 - xi * xi) * m2)
        return _ray(t[..., None] * m, t * n - xi * (m2 + n * n))


_MODELS = {
    v1.DISTORTION_MODEL_FOV: _Fov,
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL: _RadialTangential,
    v1.DISTORTION_MODEL_EQUIDISTANT: _Equidistant,
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_5: _RadialTangential,
    v1.DISTORTION_MODEL_RADIAL_TANGENTIAL_8: _RadialTangential,
    v1.DISTORTION_MODEL_UNIFIED: _Unified,
    v1.DISTORTION_MODEL_EXTENDED_UNIFIED: _ExtendedUnified,
    v1.DISTORTION_MODEL_DOUBLE_SPHERE: _DoubleSphere,
}


def model(camera: v1.CameraCalibration):
    """Returns the model of a camera, with its coefficients."""
    if camera.distortion_model not in _MODELS:
        raise ValueError(f"unknown distortion model {camera.distortion_model}")
    return _MODELS[camera.distortion_model](list(camera.distortion))
