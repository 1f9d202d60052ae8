#include "core/factor/reprojection_batch.h"

#include <algorithm>

#include "core/factor/reprojection_lanes.h"

namespace selfcal {
namespace {

void CopyByRows(const Eigen::Matrix3d& M, double* to) {
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> map(to);
  map = M;
}

bool IsRolling(const ObservationRun& run) {
  return run.camera->line_delay_s.has_value();
}

// The time of the first row.
double FirstRow(const ObservationRun& run) {
  return TimeOffsetAt(*run.camera, run.motion ? run.motion->session_s : 0);
}

// The pose to which the rows refer.
ExposurePose ExposureOf(const ObservationRun& run) {
  const KeyframeState& x = *run.keyframe;
  if (run.motion == nullptr) return PoseAtRest(x.q_GI, x.p_GI);
  return MovePose(x.q_GI,
                  x.p_GI,
                  *run.motion,
                  IsRolling(run) ? run.motion->dt_s : FirstRow(run));
}

// The motion of the body while a rolling shutter reads an image.
void SetReadout(const ObservationRun& run, RunGeometry* geometry) {
  const KeyframeMotion at_rest;
  const KeyframeMotion& motion = run.motion != nullptr ? *run.motion : at_rest;
  geometry->first_row_s = FirstRow(run) - motion.dt_s;
  geometry->line_delay_s = *run.camera->line_delay_s;
  geometry->rate_share = motion.readout.rate_share;
  Eigen::Map<Eigen::Matrix3d>(geometry->turn) = motion.readout.turn;
  Eigen::Map<Eigen::Matrix3d>(geometry->shift) = motion.readout.shift;
}

RunGeometry GeometryOf(const ObservationRun& run) {
  RunGeometry geometry;
  const ExposurePose exposure = ExposureOf(run);
  CopyByRows(exposure.q_GI.toRotationMatrix().transpose(), geometry.R_IG);
  Eigen::Map<Eigen::Vector3d>(geometry.p_GI) = exposure.p_GI;
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(geometry.by_offset) =
      exposure.by_time;
  CopyByRows(run.camera->q_CI.toRotationMatrix(), geometry.R_CI);
  Eigen::Map<Eigen::Vector3d>(geometry.p_CI) = run.camera->p_CI;
  geometry.pixels = PixelMapOf(*run.camera);
  if (IsRolling(run)) SetReadout(run, &geometry);
  return geometry;
}

// Calls function<Kernels>(geometry, model) with the kernels for the width and
// the model.
template <typename Function>
void WithKernels(VectorWidth width,
                 const ObservationRun& run,
                 const Function& function) {
  if (run.count == 0) return;
  const RunGeometry geometry = GeometryOf(run);
  VisitCameraModel(*run.camera, [&](const auto& model) {
    using Model = std::decay_t<decltype(model)>;
    WithLanes(width, [&]<int W>() {
      if (IsRolling(run)) {
        function.template operator()<ReprojectionLanes<W, Model, true>>(
            geometry, model);
      } else {
        function.template operator()<ReprojectionLanes<W, Model, false>>(
            geometry, model);
      }
    });
    return true;
  });
}

constexpr LandmarkRows kLongestRow = {kMaxCameraTangentSize, true};

// Gives rows without the column of a time drift this column, in place: the last
// of the camera's, a multiple of that of the time offset.
void AddDriftColumn(const ObservationRun& run, double* rows) {
  const LandmarkRows with = RowsOf(*run.camera);
  const LandmarkRows without = {with.shared - 1, with.rolling};
  const int offset =
      without.Column(kCameraIntrinsics + run.camera->IntrinsicsSize());
  const double session_s = run.motion ? run.motion->session_s : 0;
  // Backwards: a row is written behind those that are still to be read.
  for (int i = 2 * run.count - 1; i >= 0; --i) {
    double row[kLongestRow.stride()] = {};
    std::copy_n(rows + i * without.stride(), without.residual() + 1, row);
    row[with.residual()] = row[without.residual()];
    row[without.residual()] = session_s * row[offset];
    std::copy_n(row, with.stride(), rows + i * with.stride());
  }
}

}  // namespace

LandmarkRows RowsOf(const CameraCalibration& camera) {
  return {CameraTangentSize(camera), camera.line_delay_s.has_value()};
}

std::optional<Eigen::Matrix<double, 6, 3>> PoseTurn(const ObservationRun& run) {
  if (run.motion == nullptr) return std::nullopt;
  return ExposureOf(run).by_rotation;
}

void ReprojectionBatch::Linearise(const ObservationRun& run,
                                  const double* points,
                                  double sigma_px,
                                  const double* weights,
                                  double* rows) const {
  WithKernels(
      width_, run, [&]<class Kernels>(const auto& geometry, const auto& model) {
        Kernels::Linearise(
            geometry, model, run, points, sigma_px, weights, rows);
      });
  if (run.camera->time_drift) AddDriftColumn(run, rows);
}

void ReprojectionBatch::AddLandmarkSums(const ObservationRun& run,
                                        const double* points,
                                        double sigma_px,
                                        double huber_sigmas,
                                        double* squares_px2,
                                        LandmarkSums* sums) const {
  WithKernels(
      width_, run, [&]<class Kernels>(const auto& geometry, const auto& model) {
        Kernels::AddLandmarkSums(geometry,
                                 model,
                                 run,
                                 points,
                                 sigma_px,
                                 huber_sigmas,
                                 squares_px2,
                                 sums);
      });
}

void ReprojectionBatch::Squares(const ObservationRun& run,
                                const double* points,
                                double* squares_px2) const {
  WithKernels(
      width_, run, [&]<class Kernels>(const auto& geometry, const auto& model) {
        Kernels::Squares(geometry, model, run, points, squares_px2);
      });
}

}  // namespace selfcal
