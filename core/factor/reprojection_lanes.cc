#include "core/factor/reprojection_lanes.h"

#include <type_traits>

#include "core/model/so3_lanes.h"
#include "core/simd/lanes.h"

namespace selfcal {
namespace {

constexpr int kLanes = SELFCAL_LANES;
using T = Lanes<kLanes>;
using Vector2 = Eigen::Matrix<T, 2, 1>;
using Vector3 = Eigen::Matrix<T, 3, 1>;
using Matrix23 = Eigen::Matrix<T, 2, 3>;
using Matrix3 = Eigen::Matrix<T, 3, 3>;

// Observations first .. first + kLanes of a run; beyond its end, the last one.
struct Batch {
  Vector3 X;  // homogeneous (X, w)
  T w;
  Vector2 z_px;
  std::int32_t landmarks[kLanes];
};

Batch Gather(const ObservationRun& run, const double* points, int first) {
  Batch batch;
  for (int i = 0; i < kLanes; ++i) {
    const int at = first + i < run.count ? first + i : run.count - 1;
    batch.landmarks[i] = run.landmarks[at];
    const double* point = points + 4 * run.landmarks[at];
    for (int j = 0; j < 3; ++j) batch.X[j].Set(i, point[j]);
    batch.w.Set(i, point[3]);
    for (int j = 0; j < 2; ++j) batch.z_px[j].Set(i, run.z_px[2 * at + j]);
  }
  return batch;
}

// M v for a row-major matrix.
Vector3 Turn(const double* M, const Vector3& v) {
  return {M[0] * v[0] + M[1] * v[1] + M[2] * v[2],
          M[3] * v[0] + M[4] * v[1] + M[5] * v[2],
          M[6] * v[0] + M[7] * v[1] + M[8] * v[2]};
}

// Transforms to the body and to the camera frame, both times w.
Vector3 ToBody(const RunGeometry& geometry, const Batch& batch) {
  const Vector3 from_body(batch.X[0] - batch.w * geometry.p_GI[0],
                          batch.X[1] - batch.w * geometry.p_GI[1],
                          batch.X[2] - batch.w * geometry.p_GI[2]);
  return Turn(geometry.R_IG, from_body);
}

Vector3 ToCamera(const RunGeometry& geometry, const Vector3& p_I, T w) {
  const Vector3 turned = Turn(geometry.R_CI, p_I);
  return {turned[0] + w * geometry.p_CI[0],
          turned[1] + w * geometry.p_CI[1],
          turned[2] + w * geometry.p_CI[2]};
}

// J M for a row-major matrix.
Matrix23 Times(const Matrix23& J, const double* M) {
  Matrix23 product;
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 3; ++c) {
      product(r, c) = J(r, 0) * M[c] + J(r, 1) * M[3 + c] + J(r, 2) * M[6 + c];
    }
  }
  return product;
}

// c1 s + c2 s^2 + c3 s^3 for a matrix of coefficients by columns, and its
// derivative.
Vector3 ValueAt(T s, const double* c) {
  return {s * (c[0] + s * (c[3] + s * c[6])),
          s * (c[1] + s * (c[4] + s * c[7])),
          s * (c[2] + s * (c[5] + s * c[8]))};
}
Vector3 SlopeAt(T s, const double* c) {
  return {c[0] + s * (2.0 * c[3] + s * (3.0 * c[6])),
          c[1] + s * (2.0 * c[4] + s * (3.0 * c[7])),
          c[2] + s * (2.0 * c[5] + s * (3.0 * c[8]))};
}

// Poses of the body at the exposures of the rows of a batch, relative to the
// pose of the run.
struct RowPoses {
  T s;
  Vector3 phi;
  Matrix3 R;
  Vector3 p;

  RowPoses(const RunGeometry& geometry, const Batch& batch)
      : s(geometry.first_row_s + geometry.line_delay_s * batch.z_px[1]),
        phi(ValueAt(s, geometry.turn)),
        R(Exp<T>(phi).toRotationMatrix()),
        p(ValueAt(s, geometry.shift)) {}

  // p_I at the rows, times w, from that in the frame of the run.
  Vector3 ToRows(const Vector3& p_run, T w) const {
    const Vector3 from_row(
        p_run[0] - w * p[0], p_run[1] - w * p[1], p_run[2] - w * p[2]);
    return R.transpose() * from_row;
  }
};

// All rows have the pose of the run if the shutter is not a rolling one.
struct RunPose {
  RunPose(const RunGeometry&, const Batch&) {}
  const Vector3& ToRows(const Vector3& p_run, T) const { return p_run; }
};
template <bool kRolling>
using Poses = std::conditional_t<kRolling, RowPoses, RunPose>;

// Residuals of a batch, with the derivatives with respect to p_I at the
// exposure and in the frame of the run.
template <class Model, bool kRolling>
struct Evaluated {
  Evaluated(const RunGeometry& geometry, const Batch& batch)
      : rows(geometry, batch),
        p_run(ToBody(geometry, batch)),
        p_I(rows.ToRows(p_run, batch.w)) {}

  Poses<kRolling> rows;
  Vector3 p_run, p_I;
  LaneMask<kLanes> valid;
  Vector2 r_px;
  ProjectionParts<T, Model::kSize> parts;
  Matrix23 by_p_I, by_p_run;
};

template <bool kRolling, class Model>
Evaluated<Model, kRolling> Evaluate(const RunGeometry& geometry,
                                    const Model& model,
                                    const Batch& batch) {
  Evaluated<Model, kRolling> e(geometry, batch);
  Vector2 z_px;
  e.valid = model.template Project<T>(
      geometry.pixels, ToCamera(geometry, e.p_I, batch.w), &z_px, &e.parts);
  e.r_px = Vector2(z_px[0] - batch.z_px[0], z_px[1] - batch.z_px[1]);
  e.by_p_I = Times(e.parts.point, geometry.R_CI);
  e.by_p_run = e.by_p_I;
  if constexpr (kRolling) e.by_p_run = e.by_p_I * e.rows.R.transpose();
  return e;
}

// by_p [p]x for row r of a derivative: with respect to the rotation of a body
// with the point p.
template <class Columns>
void SetTurn(const Matrix23& by_p, int r, const Vector3& p, Columns columns) {
  const T x = by_p(r, 0), y = by_p(r, 1), z = by_p(r, 2);
  columns[0] = y * p[2] - z * p[1];
  columns[1] = z * p[0] - x * p[2];
  columns[2] = x * p[1] - y * p[0];
}

// Rate and velocity of the body at the exposures of rows, as they count in
// derivatives: the rate in the frame there, the velocity in that of the run.
struct RowRates {
  Vector3 w, v;

  RowRates(const RunGeometry& geometry, const RowPoses& rows)
      : w(geometry.rate_share *
          (RightJacobian<T>(rows.phi) * SlopeAt(rows.s, geometry.turn))),
        v(SlopeAt(rows.s, geometry.shift)) {}
};

// Stores the part of `values` that belongs to the run.
void StorePart(T values, int first, int count, double* to) {
  if (first + kLanes <= count) {
    Store(values, to + first);
    return;
  }
  for (int i = 0; first + i < count; ++i) to[first + i] = values[i];
}

}  // namespace

template <int W, class Model, bool kRolling>
void ReprojectionLanes<W, Model, kRolling>::Linearise(
    const RunGeometry& geometry,
    const Model& model,
    const ObservationRun& run,
    const double* points,
    double sigma_px,
    const double* weights,
    double* rows) {
  // q_CI, p_CI, f, c, distortion, time offset, line delay
  constexpr LandmarkRows kRows = {
      3 + 3 + 4 + Model::kSize + 1 + (kRolling ? 1 : 0), kRolling};
  constexpr int kStride = kRows.stride();
  constexpr int kPosition = kRows.Column(3);
  constexpr int kPixels = kPosition + 3;
  constexpr int kOffset = kPixels + 4 + Model::kSize;
  for (int first = 0; first < run.count; first += W) {
    const Batch batch = Gather(run, points, first);
    const auto e = Evaluate<kRolling>(geometry, model, batch);
    T weight = 1 / sigma_px;
    if (weights != nullptr) {
      for (int i = 0; i < W; ++i) {
        weight.Set(i, first + i < run.count ? weights[first + i] : 0);
      }
    }
    const Matrix23 by_X = Times(e.by_p_run, geometry.R_IG);
    for (int r = 0; r < 2; ++r) {
      T columns[kStride];
      for (T& column : columns) column = 0.0;
      SetTurn(e.by_p_run, r, e.p_run, columns + kRowsTurn);
      for (int c = 0; c < 3; ++c) {
        columns[kRowsPosition + c] = -batch.w * by_X(r, c);
        columns[kPosition + c] = batch.w * e.parts.point(r, c);
      }
      columns[kPixels + r] = e.parts.d[r];
      columns[kPixels + 2 + r] = 1.0;
      for (int c = 0; c < Model::kSize; ++c) {
        columns[kPixels + 4 + c] = e.parts.distortion(r, c);
      }
      if constexpr (kRolling) {
        T turn[3];
        SetTurn(e.by_p_I, r, e.p_I, turn);
        for (int c = 0; c < 3; ++c) columns[kRows.Column(c)] = -turn[c];
        const RowRates rates(geometry, e.rows);
        T by_time = 0.0;
        for (int c = 0; c < 3; ++c) {
          by_time = by_time + turn[c] * rates.w[c] -
                    batch.w * (e.by_p_run(r, c) * rates.v[c]);
        }
        columns[kOffset] = by_time;
        columns[kOffset + 1] = batch.z_px[1] * columns[kOffset];
      } else {
        T by_offset = 0.0;
        for (int c = 0; c < 6; ++c) {
          by_offset =
              by_offset + geometry.by_offset[c] * columns[kRowsTurn + c];
        }
        columns[kOffset] = by_offset;
      }
      columns[kRows.residual()] = e.r_px[r];
      for (int c = 0; c <= kRows.residual(); ++c) {
        columns[c] = Select(e.valid, weight * columns[c], T(0.0));
      }
      for (int c = 0; c < kStride; c += W) {
        Transpose(columns + c);
        for (int i = 0; i < W; ++i) {
          Store(columns[c + i], rows + (2 * (first + i) + r) * kStride + c);
        }
      }
    }
  }
}

template <int W, class Model, bool kRolling>
void ReprojectionLanes<W, Model, kRolling>::AddLandmarkSums(
    const RunGeometry& geometry,
    const Model& model,
    const ObservationRun& run,
    const double* points,
    double sigma_px,
    double huber_sigmas,
    double* squares_px2,
    LandmarkSums* sums) {
  const double inverse_sigma = 1 / sigma_px;
  for (int first = 0; first < run.count; first += W) {
    const Batch batch = Gather(run, points, first);
    const auto e = Evaluate<kRolling>(geometry, model, batch);
    const Matrix23 by_X = Times(e.by_p_run, geometry.R_IG);
    const T square = e.r_px[0] * e.r_px[0] + e.r_px[1] * e.r_px[1];
    StorePart(Select(e.valid, square, T(-1.0)), first, run.count, squares_px2);
    const T norm = Sqrt(square) * inverse_sigma;
    const auto inside = norm <= T(huber_sigmas);
    const T weight =
        Select(inside, T(1.0), huber_sigmas / Max(norm, T(1e-300)));
    const T cost =
        Select(inside, norm * norm, huber_sigmas * (2.0 * norm - huber_sigmas));
    const T w =
        Select(e.valid, weight * (inverse_sigma * inverse_sigma), T(0.0));
    T sum[11];
    int at = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j) {
        sum[at++] = w * (by_X(0, i) * by_X(0, j) + by_X(1, i) * by_X(1, j));
      }
    }
    for (int i = 0; i < 3; ++i) {
      sum[at++] = w * (by_X(0, i) * e.r_px[0] + by_X(1, i) * e.r_px[1]);
    }
    sum[at++] = Select(e.valid, cost, T(0.0));
    sum[at++] = Select(e.valid, T(1.0), T(0.0));
    for (int i = 0; i < W && first + i < run.count; ++i) {
      double* to = sums[batch.landmarks[i]].values;
      for (int n = 0; n < 11; ++n) to[n] += sum[n][i];
    }
  }
}

template <int W, class Model, bool kRolling>
void ReprojectionLanes<W, Model, kRolling>::Squares(const RunGeometry& geometry,
                                                    const Model& model,
                                                    const ObservationRun& run,
                                                    const double* points,
                                                    double* squares_px2) {
  for (int first = 0; first < run.count; first += W) {
    const Batch batch = Gather(run, points, first);
    const Poses<kRolling> rows(geometry, batch);
    const Vector3 p_I = rows.ToRows(ToBody(geometry, batch), batch.w);
    Vector2 z_px;
    const auto valid = model.template Project<T>(
        geometry.pixels, ToCamera(geometry, p_I, batch.w), &z_px, nullptr);
    const T x = z_px[0] - batch.z_px[0];
    const T y = z_px[1] - batch.z_px[1];
    StorePart(
        Select(valid, x * x + y * y, T(-1.0)), first, run.count, squares_px2);
  }
}

namespace {

// Naming the kernels of a model instantiates them.
template <class Model, bool kRolling>
struct Kernels {
  using Lanes = ReprojectionLanes<kLanes, Model, kRolling>;
  decltype(&Lanes::Linearise) linearise = &Lanes::Linearise;
  decltype(&Lanes::AddLandmarkSums) add_sums = &Lanes::AddLandmarkSums;
  decltype(&Lanes::Squares) squares = &Lanes::Squares;
};
template <class List>
struct AllKernels;
template <class... Models>
struct AllKernels<CameraModelList<Models...>> : Kernels<Models, false>...,
                                                Kernels<Models, true>... {};
[[gnu::used]] constexpr AllKernels<CameraModels> kAllKernels;

}  // namespace
}  // namespace selfcal
