#include "core/elimination/keyframe_equations.h"

#include "core/elimination/chain_places.h"
#include "core/elimination/landmark_rows.h"

namespace selfcal {

using namespace chain;

void KeyframeEquations::Start(const ChainLayout& layout, int keyframes) {
  layout_ = layout;
  stride_ = kPose + layout.camera_shared + 1;
  sums_.assign(static_cast<std::size_t>(keyframes) * kPose * stride_, 0);
  shared_sums_.assign((layout.camera_shared + 1) * (layout.camera_shared + 1),
                      0);
}

void KeyframeEquations::Add(int keyframe,
                            const CameraColumns& camera,
                            const RowProducts& products,
                            const ChainPoseRotation* by_rotation) {
  const LandmarkRows& rows = camera.rows;
  // by_pose(i, c): pose i and column c; poses(i, j): two of the pose.
  const auto add_pose = [&](const auto& by_pose, const auto& poses) {
    for (int i = 0; i < kPose; ++i) {
      double* row = &sums_[(keyframe * kPose + i) * stride_];
      for (int j = 0; j <= i; ++j) row[j] += poses(i, j);
      double* shared = row + kPose + camera.offset;
      for (int c = 0; c < rows.shared; ++c) {
        const double product = by_pose(i, rows.Column(c));
        shared[c] += rows.IsNegative(c) ? -product : product;
      }
      row[kPose + layout_.camera_shared] += by_pose(i, rows.residual());
    }
  };
  if (by_rotation == nullptr) {
    add_pose(products, products);
  } else {
    Eigen::Matrix<double, kPose, kPose> turn;
    turn.setIdentity();
    turn.leftCols<3>() = *by_rotation;
    const auto by_pose = [&](int i, int c) {
      double sum = 0;
      for (int n = 0; n < kPose; ++n) sum += turn(n, i) * products(n, c);
      return sum;
    };
    add_pose(by_pose, [&](int i, int j) {
      double sum = 0;
      for (int n = 0; n < kPose; ++n) sum += by_pose(i, n) * turn(n, j);
      return sum;
    });
  }
  AddShared(camera, products);
}

void KeyframeEquations::AddShared(const CameraColumns& camera,
                                  const RowProducts& products) {
  const LandmarkRows& rows = camera.rows;
  for (int j = 0; j < rows.shared; ++j) {
    double* to =
        &shared_sums_[(camera.offset + j) * (layout_.camera_shared + 1)];
    for (int i = j; i < rows.shared; ++i) {
      const double product = products(rows.Column(i), rows.Column(j));
      to[camera.offset + i] +=
          rows.IsNegative(i) == rows.IsNegative(j) ? product : -product;
    }
    const double product = products(rows.residual(), rows.Column(j));
    to[layout_.camera_shared] += rows.IsNegative(j) ? -product : product;
  }
}

void KeyframeEquations::AddKeyframeTo(ChainFront* front, int keyframe) const {
  const int pose = front->Pose(0);
  for (int i = 0; i < kPose; ++i) {
    const double* row = &sums_[(keyframe * kPose + i) * stride_];
    for (int j = 0; j <= i; ++j) (*front)(pose + i, pose + j) += row[j];
    for (int c = 0; c <= layout_.camera_shared; ++c) {
      (*front)(pose + i, layout_.camera_place + c) += row[kPose + c];
    }
  }
}

void KeyframeEquations::AddSharedTo(ChainFront* front) const {
  const int rows = layout_.camera_shared + 1;
  for (int j = 0; j < layout_.camera_shared; ++j) {
    for (int i = j; i < rows; ++i) {
      (*front)(layout_.camera_place + i, layout_.camera_place + j) +=
          shared_sums_[j * rows + i];
    }
  }
}

}  // namespace selfcal
