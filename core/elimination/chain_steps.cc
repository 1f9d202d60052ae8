#include "core/elimination/chain_steps.h"

#include <span>

#include "core/elimination/chain_places.h"

namespace selfcal {

using namespace chain;

namespace {

using RowMajorPanel =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <int kState>
void FindStateStep(const EliminatedChain& chain,
                   int k,
                   const Eigen::VectorXd& z,
                   const ChainStateVector* next,
                   ChainStateVector* state) {
  using RowMajorRoot =
      Eigen::Matrix<double, kState, WholeVectors(kState), Eigen::RowMajor>;
  const ChainRecord::Step& step = chain.record.step(k);
  const Eigen::Map<const RowMajorPanel> P(
      chain.record.Product(step), kState, step.stride);
  const auto root = Eigen::Map<const RowMajorRoot>(chain.record.Root(step))
                        .template leftCols<kState>();
  Eigen::Matrix<double, kState, 1> x = -(root * (P * z.head(step.stride)));
  if (step.linked) {
    const ChainTransition link = chain.record.Link(step);
    const TransitionColumns& at = link.columns;
    const Eigen::Map<const RowMajorPanel> G(link.G, kState, at.stride);
    x += G.leftCols(at.constant) * z.head(at.constant) + G.col(at.constant) +
         G.middleCols<kPose>(at.next_pose) * next->head<kPose>();
  }
  *state = x;
}

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
    z->segment(chain.layout.motion_place(), chain.layout.motion_size) =
        states[k + 1].tail(chain.layout.motion_size);
  }
}

void FindStateSteps(const EliminatedChain& chain,
                    Eigen::VectorXd z,
                    std::vector<ChainStateVector>* states) {
  const int keyframes = chain.structure.keyframes();
  states->resize(keyframes);
  for (int k = keyframes - 1; k >= 0; --k) {
    PlaceStates(chain, k, *states, &z);
    const ChainStateVector* next =
        k + 1 < keyframes ? &(*states)[k + 1] : nullptr;
    WithStateSize(chain.layout.state_size(), [&]<int kState>() {
      FindStateStep<kState>(chain, k, z, next, &(*states)[k]);
    });
  }
}

}  // namespace selfcal
