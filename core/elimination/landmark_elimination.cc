#include "core/elimination/landmark_elimination.h"

#include <algorithm>
#include <cstddef>

#include "core/elimination/chain_kernels.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/small_cholesky.h"

namespace selfcal {

using namespace chain;

void LandmarkElimination::Start(const ChainShape& shape,
                                const ChainLayout& layout) {
  layout_ = layout;
  const std::size_t landmarks = shape.tracks.size() - 1;
  kept_.assign(landmarks, kEliminated);
  std::copy(
      shape.kept_landmarks.begin(), shape.kept_landmarks.end(), kept_.begin());
  GrowTo(6 * landmarks, &roots_);
}

void LandmarkElimination::SetRoot(int landmark, Eigen::Matrix3d information) {
  Eigen::Matrix3d& L = information;
  GuardedCholesky<3>(&L);
  double* root = &roots_[6 * landmark];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) root[i * (i + 1) / 2 + j] = L(i, j);
    root[i * (i + 1) / 2 + i] = 1 / L(i, i);
  }
}

// Adds a kept landmark to the front, instead of eliminating it; its panel
// eliminates nothing.
void LandmarkElimination::KeepLandmark(int landmark,
                                       int slots,
                                       const Eigen::Matrix3d& information,
                                       double* panel,
                                       int stride,
                                       ChainFront* front) {
  const int place = layout_.kept_place + kept_[landmark];
  const int shared = layout_.fixed - layout_.camera_place;
  const int poses = slots * kPose;
  for (int j = 0; j < 3; ++j) {
    double* row = panel + j * stride;
    for (int i = j; i < 3; ++i) {
      (*front)(place + i, place + j) += information(i, j);
    }
    for (int c = 0; c <= layout_.camera_shared; ++c) {
      (*front)(layout_.camera_place + c, place + j) += row[c];
    }
    for (int i = 0; i < poses; ++i) {
      (*front)(front->Pose(0) + i, place + j) += row[shared + i];
    }
    Zero(row, shared + poses);
  }
  SetRoot(landmark, Eigen::Matrix3d::Identity());
}

// The staircase of a group, whose landmarks with most slots come first.
void LandmarkElimination::SetDepths(const ChainStructure& structure,
                                    std::span<const int> group) {
  const int slots = structure.Slots(group.front());
  depths_.assign(slots, 0);
  for (const int m : group) depths_[structure.Slots(m) - 1] += 3;
  for (int s = slots - 1; s > 0; --s) depths_[s - 1] += depths_[s];
}

void LandmarkElimination::Eliminate(const ChainStructure& structure,
                                    int k,
                                    bool record,
                                    LandmarkEquations* sums,
                                    ChainFront* front) {
  const std::span<const int> group = structure.Landmarks(k);
  if (group.empty()) return;
  const int camera_place = layout_.camera_place;
  const int shared = layout_.fixed - camera_place;
  const int slots = structure.Slots(group.front());
  const int stride = shared + WholeVectors(slots * kPose) + kZeros;
  const int depth = 3 * static_cast<int>(group.size());
  GrowTo(static_cast<std::size_t>(depth) * stride, &panels_);
  SetDepths(structure, group);
  const auto panel_of = [&](std::size_t place) {
    return &panels_[place * 3 * stride];
  };
  for (std::size_t i = 0; i < group.size(); ++i) {
    const int m = group[i];
    double* panel = panel_of(i);
    const Eigen::Matrix3d information = sums->PreparePanel(m, panel, stride);
    if (kept_[m] == kEliminated) {
      SetRoot(m, information);
    } else {
      KeepLandmark(m, structure.Slots(m), information, panel, stride, front);
    }
  }
  const ConstPanel by_shared = {panels_.data(), stride};
  const ConstPanel by_pose = {panels_.data() + shared, stride};
  const int pose = front->Pose(0);
  WithKernels(width_, [&](auto kernels) {
    for (std::size_t i = 0; i < group.size(); ++i) {
      kernels.SolveThreeRows(&roots_[6 * group[i]],
                             panel_of(i),
                             stride,
                             shared + structure.Slots(group[i]) * kPose);
    }
    kernels.AddSquare(
        -1, by_shared, shared, depth, front->At(camera_place, camera_place));
    const Depth stairs(depths_.data(), kPose);
    kernels.AddProduct(-1,
                       by_pose,
                       slots * kPose,
                       by_shared,
                       layout_.camera_shared + 1,
                       stairs,
                       front->At(pose, camera_place));
    kernels.AddSquare(
        -1, by_pose, slots * kPose, stairs, front->At(pose, pose));
  });
  if (!record) return;
  for (std::size_t i = 0; i < group.size(); ++i) {
    sums->RecordPanel(group[i], panel_of(i), stride);
  }
}

void LandmarkElimination::FindSteps(
    const LandmarkEquations& sums,
    const Eigen::VectorXd& z,
    const std::vector<ChainStateVector>& states,
    std::vector<Eigen::Vector3d>* landmarks) const {
  landmarks->resize(kept_.size());
  for (std::size_t m = 0; m < kept_.size(); ++m) {
    Eigen::Vector3d& x = (*landmarks)[m];
    if (kept_[m] != kEliminated) {
      x = z.segment<3>(layout_.kept_place + kept_[m]);
      continue;
    }
    const Eigen::Vector3d y =
        sums.ByRecordedPanel(static_cast<int>(m), z, states);
    // L^T x = -y, the diagonal of L inverted.
    const double* L = &roots_[6 * m];
    x(2) = -y(2) * L[5];
    x(1) = (-y(1) - L[4] * x(2)) * L[2];
    x(0) = (-y(0) - L[1] * x(1) - L[3] * x(2)) * L[0];
  }
}

}  // namespace selfcal
