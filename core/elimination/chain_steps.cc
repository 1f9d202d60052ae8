#include "core/elimination/chain_steps.h"

#include <span>

#include "core/elimination/chain_places.h"

namespace selfcal {

using namespace chain;

namespace {

using RowMajorRoot = Eigen::Matrix<double, kState, kTileState, Eigen::RowMajor>;
using RowMajorLink =
    Eigen::Matrix<double, kState, kTransitionColumns, Eigen::RowMajor>;
using RowMajorPanel =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

Eigen::VectorXd SharedInPlaces(const EliminatedChain& chain,
                               const Eigen::VectorXd& shared) {
  const ChainLayout& layout = chain.layout;
  Eigen::VectorXd z =
      Eigen::VectorXd::Zero(layout.fixed + chain.structure.max_slots() * kPose);
  for (int i = 0; i < layout.shared_size(); ++i) z(layout.Place(i)) = shared(i);
  z(layout.constant) = 1;
  return z;
}

void PlaceStates(const EliminatedChain& chain,
                 int k,
                 const std::vector<ChainStateVector>& states,
                 Eigen::VectorXd* z) {
  const std::span<const int> poses = chain.structure.Poses(k);
  for (std::size_t s = 1; s < poses.size(); ++s) {
    z->segment<kPose>(chain.layout.fixed + (s - 1) * kPose) =
        states[poses[s]].head<kPose>();
  }
  if (k + 1 < chain.structure.keyframes()) {
    z->segment<kMotion>(kMotionPlace) = states[k + 1].tail<kMotion>();
  }
}

void FindStateSteps(const EliminatedChain& chain,
                    Eigen::VectorXd z,
                    std::vector<ChainStateVector>* states) {
  const int keyframes = chain.structure.keyframes();
  states->resize(keyframes);
  for (int k = keyframes - 1; k >= 0; --k) {
    const ChainRecord::Step& step = chain.record.step(k);
    PlaceStates(chain, k, *states, &z);
    const Eigen::Map<const RowMajorPanel> P(
        chain.record.Product(step), kState, step.stride);
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
}

}  // namespace selfcal
