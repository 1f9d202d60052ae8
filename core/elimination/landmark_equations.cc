#include "core/elimination/landmark_equations.h"

#include <algorithm>
#include <span>

#include "core/elimination/chain_places.h"
#include "core/elimination/landmark_rows.h"

namespace selfcal {

using namespace chain;

void LandmarkEquations::Start(const ChainShape& shape,
                              const ChainStructure& structure,
                              const ChainLayout& layout) {
  layout_ = layout;
  cameras_.clear();
  sums_offsets_.clear();
  sums_size_ = 0;
  int offset = 0;
  for (const LandmarkRows& rows : shape.cameras) {
    cameras_.push_back({rows, offset});
    offset += rows.shared;
    sums_offsets_.push_back(sums_size_);
    sums_size_ += 3 * rows.stride();
  }
  views_.Find(shape, structure);
  const auto landmarks = static_cast<std::size_t>(views_.landmarks());
  sums_.assign(landmarks * sums_size_, 0);
  priors_.assign(landmarks * 9, 0);
  pose_rows_.assign(views_.size() * 3 * kPose, 0);
}

// Number of doubles in a row over the poses that observe a landmark.
int LandmarkEquations::PosesOf(int landmark) const {
  return static_cast<int>(views_.Of(landmark).size()) * kPose;
}

// Index of such a row.
std::size_t LandmarkEquations::PoseRow(int landmark, int row) const {
  return static_cast<std::size_t>(views_.Begin(landmark)) * 3 * kPose +
         row * PosesOf(landmark);
}

LandmarkTarget LandmarkEquations::TargetOf(int observation, int camera) {
  const int m = views_.LandmarkOf(observation);
  return {&sums_[m * sums_size_ + sums_offsets_[camera]],
          &pose_rows_[PoseRow(m, 0)] + views_.ViewOf(observation) * kPose,
          PosesOf(m)};
}

void LandmarkEquations::AddPrior(int landmark,
                                 const Eigen::Matrix3d& H,
                                 const Eigen::Vector3d& g) {
  double* prior = &priors_[9 * landmark];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) prior[i * (i + 1) / 2 + j] += H(i, j);
    prior[6 + i] += g(i);
  }
}

Eigen::Matrix3d LandmarkEquations::PreparePanel(int landmark,
                                                double* panel,
                                                int stride) const {
  const double* prior = &priors_[9 * landmark];
  const int camera_shared = layout_.camera_shared;
  const int shared_places = layout_.fixed - layout_.camera_place;
  Eigen::Matrix3d H;
  for (int j = 0; j < 3; ++j) {
    double* row = panel + j * stride;
    Zero(row, stride);
    const double* by_pose = &pose_rows_[PoseRow(landmark, j)];
    for (const LandmarkViews::View& view : views_.Of(landmark)) {
      std::copy_n(by_pose, kPose, row + shared_places + view.slot * kPose);
      by_pose += kPose;
    }
    for (int i = 0; i <= j; ++i) H(j, i) = prior[j * (j + 1) / 2 + i];
    row[camera_shared] = prior[6 + j];
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const LandmarkRows& rows = cameras_[c].rows;
      const double* sums =
          &sums_[landmark * sums_size_ + sums_offsets_[c] + j * rows.stride()];
      double* shared = row + cameras_[c].offset;
      for (int i = 0; i < rows.shared; ++i) {
        const double sum = sums[rows.Column(i)];
        shared[i] = rows.IsNegative(i) ? -sum : sum;
      }
      row[camera_shared] += sums[rows.residual()];
      for (int i = 0; i <= j; ++i) H(j, i) -= sums[kRowsPosition + i];
    }
  }
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  return H;
}

void LandmarkEquations::RecordPanel(int landmark,
                                    const double* panel,
                                    int stride) {
  double* shared = &sums_[landmark * sums_size_];
  for (int j = 0; j < 3; ++j) {
    const double* row = panel + j * stride;
    shared = std::copy_n(row, layout_.camera_shared + 1, shared);
    row += layout_.fixed - layout_.camera_place;
    double* by_pose = &pose_rows_[PoseRow(landmark, j)];
    for (const LandmarkViews::View& view : views_.Of(landmark)) {
      by_pose = std::copy_n(row + view.slot * kPose, kPose, by_pose);
    }
  }
}

Eigen::Vector3d LandmarkEquations::ByRecordedPanel(
    int landmark,
    const Eigen::VectorXd& z,
    const std::vector<ChainStateVector>& states) const {
  const auto rows = [](const double* data, Eigen::Index columns) {
    return Eigen::Map<
        const Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>(
        data, 3, columns);
  };
  const std::span<const LandmarkViews::View> views = views_.Of(landmark);
  const auto by_pose =
      rows(&pose_rows_[PoseRow(landmark, 0)], PosesOf(landmark));
  const Eigen::Index shared_places = layout_.camera_shared + 1;
  Eigen::Vector3d y = rows(&sums_[landmark * sums_size_], shared_places) *
                      z.segment(layout_.camera_place, shared_places);
  for (std::size_t v = 0; v < views.size(); ++v) {
    y += by_pose.middleCols<kPose>(static_cast<Eigen::Index>(v) * kPose) *
         states[views[v].keyframe].head<kPose>();
  }
  return y;
}

}  // namespace selfcal
