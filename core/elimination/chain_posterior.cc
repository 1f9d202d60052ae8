// Given the front z that remained when a state was eliminated, the state is
//   C z + noise of covariance root root^T,
// and the noise of its link is
//   -L^-T (P z + noise of unit covariance).
// Everything that was in the front before is either the state, or still in the
// front.
#include "core/elimination/chain_posterior.h"

#include <algorithm>
#include <cstddef>
#include <span>

#include "core/elimination/chain_kernels.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/chain_steps.h"

namespace selfcal {

using namespace chain;

namespace {

using ConstPanelMap = Eigen::Map<
    const Eigen::
        Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>,
    0,
    Eigen::OuterStride<>>;

// Places of poses while they are in the front; the first free place is used
// first.
class PosePlaces {
 public:
  explicit PosePlaces(int places) : keyframes_(places, kFree) {}

  int Find(int keyframe) const {
    return static_cast<int>(
        std::find(keyframes_.begin(), keyframes_.end(), keyframe) -
        keyframes_.begin());
  }
  int Enter(int keyframe) {
    const int place = Find(kFree);
    keyframes_[place] = keyframe;
    return place;
  }
  // Frees all places except those of `keyframes`.
  void Keep(std::span<const int> keyframes) {
    for (int& at : keyframes_) {
      if (std::find(keyframes.begin(), keyframes.end(), at) ==
          keyframes.end()) {
        at = kFree;
      }
    }
  }
  // The first place after which all are free.
  int end() const {
    int end = static_cast<int>(keyframes_.size());
    while (end > 0 && keyframes_[end - 1] == kFree) --end;
    return end;
  }

 private:
  static constexpr int kFree = -1;
  std::vector<int> keyframes_;
};

// The covariance of the front, by places: first the fixed part as in a panel,
// then poses, each in one place as long as it is in the front. Values in other
// places are finite, and not used.
template <int kState>
class CovarianceWalk {
  static constexpr int kTileState = WholeVectors(kState);
  using StateMatrix = Eigen::Matrix<double, kState, kState>;
  using RowMajorState = Eigen::Map<
      const Eigen::Matrix<double, kState, kTileState, Eigen::RowMajor>>;

 public:
  CovarianceWalk(const EliminatedChain& chain,
                 VectorWidth width,
                 const Eigen::MatrixXd& shared)
      : layout_(chain.layout),
        structure_(chain.structure),
        record_(chain.record),
        width_(width),
        poses_(structure_.max_slots()),
        stride_(WholeVectors(layout_.fixed + structure_.max_slots() * kPose) +
                kZeros),
        covariance_(static_cast<std::size_t>(stride_) * stride_, 0.0),
        product_(static_cast<std::size_t>(kState) * stride_, 0.0),
        with_front_(product_),
        panel_(static_cast<std::size_t>(stride_) * kTileState, 0.0) {
    for (int j = 0; j < layout_.shared_size(); ++j) {
      for (int i = 0; i < layout_.shared_size(); ++i) {
        At(layout_.Place(i), layout_.Place(j)) = shared(i, j);
      }
    }
  }

  // Reverses the elimination of keyframe k.
  void Reverse(int k) {
    const ChainRecord::Step& step = record_.step(k);
    const std::span<const int> poses = structure_.Poses(k);
    size_ = layout_.fixed + poses_.end() * kPose;
    SetPanel(step, poses);
    Multiply(step, poses);
    SetState(step, poses);
  }
  // Prepares for keyframe k - 1: k takes a place, and poses that were not in
  // the front at that time leave it.
  void Enter(int k) {
    poses_.Keep(structure_.Poses(k - 1).subspan(1));
    const int pose = layout_.fixed + poses_.Enter(k) * kPose;
    const auto put = [&](int m, int place) {
      const double* row = &with_front_[m * stride_];
      std::copy_n(row, size_, &At(0, place));
      for (int i = 0; i < size_; ++i) At(place, i) = row[i];
    };
    const auto place = [&](int m) {
      return m < kPose ? pose + m : layout_.motion_place() + m - kPose;
    };
    for (int m = 0; m < kState; ++m) put(m, place(m));
    for (int j = 0; j < kState; ++j) {
      for (int i = 0; i < kState; ++i) At(place(i), place(j)) = state_(i, j);
    }
  }

  const StateMatrix& state() const { return state_; }
  // Noise of its link, for the values z of the front.
  ChainNoiseVector Noise(const ChainRecord::Step& step,
                         const Eigen::VectorXd& z,
                         const ChainStateVector& next) const {
    const ConstPanelMap P(record_.Product(step),
                          kState,
                          step.stride,
                          Eigen::OuterStride<>(step.stride));
    ChainNoiseVector noise(kState + step.rows);
    noise.head<kState>() = -Factor(step).solve(P * z.head(step.stride));
    if (step.rows > 0) {
      const ChainTransition link = record_.Link(step);
      const ConstPanelMap H = Rows(link);
      const TransitionColumns& at = link.columns;
      noise.tail(step.rows) =
          H.leftCols(at.constant) * z.head(at.constant) + H.col(at.constant) +
          H.middleCols<kPose>(at.next_pose) * next.head<kPose>();
    }
    return noise;
  }
  // Covariance of that.
  ChainNoiseMatrix NoiseCovariance(const ChainRecord::Step& step,
                                   std::span<const int> poses) const {
    const auto factor = Factor(step);
    const StateMatrix half =
        factor.solve(StateMatrix::Identity() + ByPanel(product_));
    ChainNoiseMatrix covariance(kState + step.rows, kState + step.rows);
    covariance.topLeftCorner<kState, kState>() =
        factor.solve(half.transpose().eval());
    if (step.rows > 0) AddRows(step, poses, &covariance);
    return covariance;
  }
  Eigen::MatrixXd WithShared() const {
    Eigen::MatrixXd columns(kState, layout_.shared_size());
    for (int i = 0; i < layout_.shared_size(); ++i) {
      for (int m = 0; m < kState; ++m) {
        columns(m, i) = with_front_[m * stride_ + layout_.Place(i)];
      }
    }
    return columns;
  }

 private:
  auto Factor(const ChainRecord::Step& step) const {
    return RowMajorState(record_.Factor(step))
        .template leftCols<kState>()
        .template triangularView<Eigen::Upper>();
  }
  static ConstPanelMap Rows(const ChainTransition& link) {
    return {link.H,
            link.rows,
            link.columns.stride,
            Eigen::OuterStride<>(link.columns.stride)};
  }
  // Adds that of the further rows H z of a link, with its noise and with each
  // other.
  void AddRows(const ChainRecord::Step& step,
               std::span<const int> poses,
               ChainNoiseMatrix* covariance) const {
    const ChainTransition link = record_.Link(step);
    const TransitionColumns& at = link.columns;
    const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> front(
        covariance_.data(), size_, size_, Eigen::OuterStride<>(stride_));
    const ConstPanelMap product(
        product_.data(), kState, size_, Eigen::OuterStride<>(stride_));
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(step.rows, size_);
    H.leftCols(at.constant) = Rows(link).leftCols(at.constant);
    H.middleCols<kPose>(PlaceOf(poses[1])) =
        Rows(link).middleCols<kPose>(at.next_pose);
    const Eigen::MatrixXd with_noise =
        -Factor(step).solve(product * H.transpose());
    covariance->topRightCorner(kState, step.rows) = with_noise;
    covariance->bottomLeftCorner(step.rows, kState) = with_noise.transpose();
    covariance->bottomRightCorner(step.rows, step.rows) =
        H * front * H.transpose();
  }

  double& At(int i, int j) {
    return covariance_[static_cast<std::size_t>(j) * stride_ + i];
  }
  int PlaceOf(int keyframe) const {
    return layout_.fixed + poses_.Find(keyframe) * kPose;
  }

  // The transpose of P, by places.
  void SetPanel(const ChainRecord::Step& step, std::span<const int> poses) {
    std::fill_n(panel_.begin(), size_ * kTileState, 0.0);
    const double* P = record_.Product(step);
    const auto copy = [&](int from, int to, int count) {
      for (int i = 0; i < count; ++i) {
        for (int k = 0; k < kState; ++k) {
          panel_[(to + i) * kTileState + k] = P[k * step.stride + from + i];
        }
      }
    };
    copy(0, 0, layout_.fixed);
    for (std::size_t s = 1; s < poses.size(); ++s) {
      copy(layout_.fixed + static_cast<int>(s - 1) * kPose,
           PlaceOf(poses[s]),
           kPose);
    }
  }

  // product_ = P covariance, and with_front_ = (G - root P) covariance.
  void Multiply(const ChainRecord::Step& step, std::span<const int> poses) {
    alignas(64) double root[kState][kTileState] = {};
    alignas(64) double G[kMaxTransitionColumns][kTileState] = {};
    const int kept_place = layout_.kept_place;
    for (int i = 0; i < kState; ++i) {
      for (int j = 0; j < kState; ++j) {
        root[j][i] = record_.Root(step)[i * kTileState + j];
      }
      if (!step.linked) continue;
      const ChainTransition link = record_.Link(step);
      const double* row = link.G + i * link.columns.stride;
      for (int c = 0; c < kept_place; ++c) G[c][i] = row[c];
      for (int c = 0; c < kPose; ++c) {
        G[kept_place + c][i] = row[link.columns.next_pose + c];
      }
    }
    const int next =
        step.linked ? PlaceOf(poses[1]) : 0;  // G is zero without a link
    WithKernels(width_, [&](auto kernels) {
      kernels.SetProduct({covariance_.data(), stride_},
                         size_,
                         {panel_.data(), kTileState},
                         kState,
                         size_,
                         {product_.data(), stride_});
      kernels.SetProduct({covariance_.data(), stride_},
                         size_,
                         {&G[0][0], kTileState},
                         kState,
                         kept_place,
                         {with_front_.data(), stride_});
      kernels.AddProduct(1,
                         {&At(0, next), stride_},
                         size_,
                         {&G[kept_place][0], kTileState},
                         kState,
                         kPose,
                         {with_front_.data(), stride_});
      kernels.AddProduct(-1,
                         {product_.data(), stride_},
                         size_,
                         {&root[0][0], kTileState},
                         kState,
                         kState,
                         {with_front_.data(), stride_});
    });
  }

  // The product of rows over the front with the transpose of P.
  StateMatrix ByPanel(const std::vector<double>& rows) const {
    return ConstPanelMap(
               rows.data(), kState, size_, Eigen::OuterStride<>(stride_)) *
           ConstPanelMap(
               panel_.data(), size_, kState, Eigen::OuterStride<>(kTileState));
  }

  // with_front_ (G - root P)^T, plus the state's own covariance.
  void SetState(const ChainRecord::Step& step, std::span<const int> poses) {
    const auto root =
        RowMajorState(record_.Root(step)).template leftCols<kState>();
    state_ = (root - ByPanel(with_front_)) * root.transpose();
    if (step.linked) {
      const ChainTransition link = record_.Link(step);
      const TransitionColumns& at = link.columns;
      const ConstPanelMap G(
          link.G, kState, at.stride, Eigen::OuterStride<>(at.stride));
      const ConstPanelMap with_front(
          with_front_.data(), kState, size_, Eigen::OuterStride<>(stride_));
      state_ += with_front.leftCols(at.constant) *
                    G.leftCols(at.constant).transpose() +
                with_front.middleCols<kPose>(PlaceOf(poses[1])) *
                    G.middleCols<kPose>(at.next_pose).transpose();
    }
    state_ = (0.5 * (state_ + state_.transpose())).eval();
  }

  const ChainLayout& layout_;
  const ChainStructure& structure_;
  const ChainRecord& record_;
  const VectorWidth width_;
  PosePlaces poses_;
  const int stride_;
  int size_ = 0;  // of the front, by places
  std::vector<double> covariance_;
  // Rows of the state over the front: P covariance, and the covariance of the
  // state with the front.
  std::vector<double> product_, with_front_;
  std::vector<double> panel_;
  StateMatrix state_;
};

template <int kState>
void FindPosteriorOf(const EliminatedChain& chain,
                     VectorWidth width,
                     const Eigen::VectorXd& shared,
                     const Eigen::MatrixXd& shared_covariance,
                     const std::vector<ChainStateVector>& states,
                     ChainPosterior* posterior) {
  const int keyframes = chain.structure.keyframes();
  Eigen::VectorXd z = SharedInPlaces(chain, shared);
  CovarianceWalk<kState> walk(chain, width, shared_covariance);
  for (int k = keyframes - 1; k >= 0; --k) {
    const ChainRecord::Step& step = chain.record.step(k);
    walk.Reverse(k);
    posterior->state_covariance[k] = walk.state();
    if (k + 1 == keyframes) posterior->last_with_shared = walk.WithShared();
    if (k == 0) posterior->first_with_shared = walk.WithShared();
    if (step.linked) {
      PlaceStates(chain, k, states, &z);
      posterior->noise[k] = walk.Noise(step, z, states[k + 1]);
      posterior->noise_covariance[k] =
          walk.NoiseCovariance(step, chain.structure.Poses(k));
    }
    if (k > 0) walk.Enter(k);
  }
}

}  // namespace

void FindChainPosterior(const EliminatedChain& chain,
                        VectorWidth width,
                        const Eigen::VectorXd& shared,
                        const Eigen::MatrixXd& shared_covariance,
                        const std::vector<ChainStateVector>& states,
                        ChainPosterior* posterior) {
  const int keyframes = chain.structure.keyframes();
  posterior->noise.resize(keyframes - 1);
  posterior->noise_covariance.resize(keyframes - 1);
  posterior->state_covariance.resize(keyframes);
  WithStateSize(chain.layout.state_size(), [&]<int kState>() {
    FindPosteriorOf<kState>(
        chain, width, shared, shared_covariance, states, posterior);
  });
}

}  // namespace selfcal
