// Back-substitution through a chain: from a step of the shared parameters to
// the steps of all eliminated unknowns.
#include <Eigen/Core>

#include "core/elimination/chain_elimination.h"
#include "core/elimination/chain_places.h"

namespace selfcal {

using namespace chain;

namespace {

using RowMajorRoot = Eigen::Matrix<double, kState, 16, Eigen::RowMajor>;
using RowMajorLink = Eigen::Matrix<double, kState, 32, Eigen::RowMajor>;
using RowMajorPanel =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

// Shared values at the places of a panel, with zeros for states.
Eigen::VectorXd ChainElimination::SharedInPlaces(
    const Eigen::VectorXd& shared) const {
  Eigen::VectorXd z = Eigen::VectorXd::Zero(panel_stride_);
  for (int i = 0; i < shared_size(); ++i) z(Place(i)) = shared(i);
  z(constant_) = 1;
  return z;
}

// The states that were in the front after the elimination of a keyframe.
void ChainElimination::PlaceStates(int k,
                                   const std::vector<ChainStateVector>& states,
                                   Eigen::VectorXd* z) const {
  const std::span<const int> poses = structure_.Poses(k);
  for (std::size_t s = 1; s < poses.size(); ++s) {
    z->segment<kPose>(fixed_ + (s - 1) * kPose) =
        states[poses[s]].head<kPose>();
  }
  if (k + 1 < structure_.keyframes()) {
    z->segment<kMotion>(kMotionPlace) = states[k + 1].tail<kMotion>();
  }
}

void ChainElimination::FindSteps(
    const Eigen::VectorXd& shared,
    std::vector<ChainStateVector>* states,
    std::vector<Eigen::Vector3d>* landmarks) const {
  const int keyframes = structure_.keyframes();
  states->resize(keyframes);
  landmarks->resize(landmarks_count_);
  Eigen::VectorXd z = SharedInPlaces(shared);

  for (int k = keyframes - 1; k >= 0; --k) {
    const Step& step = steps_[k];
    PlaceStates(k, *states, &z);
    const Eigen::Map<const RowMajorPanel> P(
        &products_[step.product], kState, step.stride);
    const auto root =
        Eigen::Map<const RowMajorRoot>(&step.root[0][0]).leftCols<kState>();
    ChainStateVector& x = (*states)[k];
    x = -(root * (P * z.head(step.stride)));
    if (step.linked) {
      const Eigen::Map<const RowMajorLink> G(&step.link.G[0][0]);
      x += G.leftCols<kKeptPlace>() * z.head<kKeptPlace>() +
           G.col(kTransitionConstant) +
           G.middleCols<kPose>(kTransitionNextPose) *
               (*states)[k + 1].head<kPose>();
    }
  }

  for (std::size_t m = 0; m < landmarks_count_; ++m) {
    Eigen::Vector3d& x = (*landmarks)[m];
    if (kept_landmarks_[m] != kEliminated) {
      x = z.segment<3>(kKeptPlace + kept_landmarks_[m]);
      continue;
    }
    const auto rows = [](const double* data, Eigen::Index columns) {
      return Eigen::Map<
          const Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>(
          data, 3, columns);
    };
    const int begin = views_begin_[m];
    const int count = views_begin_[m + 1] - begin;
    const auto by_pose =
        rows(&pose_rows_[static_cast<std::size_t>(begin) * 3 * kPose],
             count * kPose);
    const Eigen::Index shared_places = landmark_shared_ + 1;
    Eigen::Vector3d y = rows(&sums_[m * sums_size_], shared_places) *
                        z.segment(landmark_place_, shared_places);
    for (int v = 0; v < count; ++v) {
      y += by_pose.middleCols<kPose>(v * kPose) *
           (*states)[views_[begin + v].keyframe].head<kPose>();
    }
    // L^T x = -y, the diagonal of L inverted.
    const double* L = &roots_[6 * m];
    x(2) = -y(2) * L[5];
    x(1) = (-y(1) - L[4] * x(2)) * L[2];
    x(0) = (-y(0) - L[1] * x(1) - L[3] * x(2)) * L[0];
  }
}

}  // namespace selfcal
