#include "core/elimination/observation_products.h"

#include <Eigen/Core>
#include <cstddef>

#include "core/elimination/chain_kernels.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/landmark_rows.h"

namespace selfcal {

using namespace chain;

RowProducts ObservationProducts::Add(VectorWidth width,
                                     int camera,
                                     const double* rows,
                                     std::span<const int> observations,
                                     const ChainPoseRotation* by_rotation,
                                     LandmarkEquations* landmarks) {
  const LandmarkRows& columns = landmarks->camera(camera).rows;
  const int stride = columns.stride();
  const int gram_stride = stride + kPanelPad;
  const int count = static_cast<int>(observations.size());
  GrowTo(observations.size(), &targets_);
  for (int i = 0; i < count; ++i) {
    targets_[i] = landmarks->TargetOf(observations[i], camera);
  }
  if (by_rotation != nullptr) CollectPoses(count);
  const std::size_t gram_size = static_cast<std::size_t>(gram_stride) * stride;
  GrowTo(gram_size, &gram_);
  Zero(gram_.data(), gram_size);
  WithKernels(width, [&](auto kernels) {
    kernels.AddLandmarkProducts(rows, stride, count, targets_.data());
    kernels.AddSquare(1,
                      {rows, stride},
                      columns.residual() + 1,
                      2 * count,
                      {gram_.data(), gram_stride});
  });
  if (by_rotation != nullptr) SpreadPoses(count, *by_rotation);
  return {gram_.data(), gram_stride};
}

// Redirects the products with the pose of each factor to a separate panel,
// until they have been rotated.
void ObservationProducts::CollectPoses(int count) {
  GrowTo(static_cast<std::size_t>(count), &panels_of_poses_);
  own_poses_.assign(static_cast<std::size_t>(count) * 3 * kOwnPoseStride, 0);
  for (int i = 0; i < count; ++i) {
    panels_of_poses_[i] = {targets_[i].poses, targets_[i].pose_stride};
    targets_[i].poses = &own_poses_[i * 3 * kOwnPoseStride];
    targets_[i].pose_stride = kOwnPoseStride;
  }
}

void ObservationProducts::SpreadPoses(
    int count, const ChainPoseRotation& by_rotation) const {
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double* from = targets_[i].poses + j * kOwnPoseStride;
      double* to = panels_of_poses_[i].data + j * panels_of_poses_[i].stride;
      Eigen::Map<Eigen::RowVector3d>(to + kRowsTurn) +=
          Eigen::Map<const Eigen::Matrix<double, 1, kPose>>(from) * by_rotation;
      for (int c = kRowsPosition; c < kRowsOwn; ++c) to[c] += from[c];
    }
  }
}

}  // namespace selfcal
