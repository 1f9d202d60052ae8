#include "core/calibration/linear_system.h"

#include <algorithm>
#include <cmath>

#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

// An observation with less weight is treated as beyond the gate: a landmark
// must not depend on observations with almost no weight.
constexpr double kLeastWeight = 1e-6;
constexpr int kMinObservations = 2;
// The modelled distance of a landmark is at most 1 / this [m].
constexpr double kLeastInverseDepth = 1e-9;

// The gauge consists of four free directions, so that a prior of any strength
// on them changes nothing else. This one is of the size of the other terms, yet
// so strong that the landmarks' priors, which are about fixed positions, do not
// move them.
constexpr double kGaugeSigma_m = 1e-5;
constexpr double kGaugeSigma_rad = 1e-5;

constexpr double kSmallTilt_rad = 0.1;
constexpr double kSmallVelocity_mps = 0.3;
constexpr double kSmallAccelBias_mps2 = 1;
constexpr double kSmallGyroBias_radps = 0.1;

double Information(double sigma) { return 1 / (sigma * sigma); }

ChainStateMatrix WeakPrior() {
  ChainStateMatrix weak = ChainStateMatrix::Zero();
  weak.diagonal().segment<3>(kStateRotation).array() =
      Information(kTiltPriorSigma_rad);
  weak.diagonal().segment<3>(kStateVelocity).array() =
      Information(kVelocityPriorSigma_mps);
  weak.diagonal().segment<3>(kStateAccelBias).array() =
      Information(kAccelBiasPriorSigma_mps2);
  weak.diagonal().segment<3>(kStateGyroBias).array() =
      Information(kGyroBiasPriorSigma_radps);
  return weak;
}

// Steps within which factors are approximately linear.
ChainStateMatrix SmallSteps() {
  ChainStateMatrix small = ChainStateMatrix::Zero();
  small.diagonal().segment<3>(kStateRotation).array() =
      Information(kSmallTilt_rad);
  small.diagonal().segment<3>(kStateVelocity).array() =
      Information(kSmallVelocity_mps);
  small.diagonal().segment<3>(kStateAccelBias).array() =
      Information(kSmallAccelBias_mps2);
  small.diagonal().segment<3>(kStateGyroBias).array() =
      Information(kSmallGyroBias_radps);
  return small;
}

// Information about position and rotation about gravity.
ChainStateMatrix GaugePrior(const KeyframeState& x) {
  ChainStateMatrix gauge = ChainStateMatrix::Zero();
  const Eigen::Vector3d up_I = x.q_GI.conjugate() * Eigen::Vector3d::UnitZ();
  gauge.block<3, 3>(kStateRotation, kStateRotation) =
      Information(kGaugeSigma_rad) * up_I * up_I.transpose();
  gauge.diagonal().segment<3>(kStatePosition).array() =
      Information(kGaugeSigma_m);
  return gauge;
}

double UsedInverseDepth(const LandmarkPlace& place) {
  const double rho = place.inverse_depth.z();
  return std::abs(rho) < kLeastInverseDepth ? kLeastInverseDepth : rho;
}

// Half of a walk from a to b, between the biases of one of them and those in
// its middle: twice the information, and half of the residual.
KeptBiasRows HalfWalk(const BiasLink& link,
                      const KeyframeState& a,
                      const KeyframeState& b,
                      double sign_of_bias) {
  const Eigen::Matrix<double, 6, 1> weight =
      std::sqrt(2.0) * link.sigmas.cwiseInverse();
  Eigen::Matrix<double, 6, 1> off;
  off << b.b_a - a.b_a, b.b_g - a.b_g;
  return {.by_bias = sign_of_bias * weight,
          .by_kept = -sign_of_bias * weight,
          .residual = 0.5 * weight.cwiseProduct(off)};
}

}  // namespace

std::vector<KeyframeChain> FindChains(const CalibrationProblem& problem) {
  const int keyframes = static_cast<int>(problem.keyframes.size());
  std::vector<bool> joined(keyframes, false);  // with the next one
  for (const InertialLink& link : problem.inertial_links) {
    joined[link.before] = true;
  }
  std::vector<KeyframeChain> chains;
  for (int k = 0; k < keyframes; ++k) {
    if (k == 0 || !joined[k - 1]) chains.push_back({k, k});
    chains.back().end = k + 1;
  }
  return chains;
}

void LinearSystem::ReleaseChains() {
  chains_.clear();
  chains_.shrink_to_fit();
}

void LinearSystem::StartChains(const CalibrationProblem& problem,
                               int cameras,
                               double damping) {
  const std::vector<KeyframeChain> ranges = FindChains(problem);
  while (chains_.size() < ranges.size()) chains_.emplace_back(width_);
  chains_.erase(chains_.begin() + static_cast<std::ptrdiff_t>(ranges.size()),
                chains_.end());
  const std::size_t keyframes = problem.keyframes.size();
  chain_of_keyframe_.resize(keyframes);
  for (std::size_t c = 0; c < ranges.size(); ++c) {
    chains_[c].range = ranges[c];
    chains_[c].landmarks.clear();
    chains_[c].tracks.assign(1, 0);
    chains_[c].track_keyframes.clear();
    chains_[c].kept_landmarks.clear();
    chains_[c].interface.clear();
    chains_[c].walk_in = {};
    chains_[c].walk_out = {};
    std::fill(chain_of_keyframe_.begin() + ranges[c].begin,
              chain_of_keyframe_.begin() + ranges[c].end,
              static_cast<int>(c));
  }
  inertial_after_.assign(keyframes, kNone);
  for (std::size_t i = 0; i < problem.inertial_links.size(); ++i) {
    inertial_after_[problem.inertial_links[i].before] = static_cast<int>(i);
  }
  priors_.assign(keyframes, ChainStateMatrix::Zero());
  has_prior_.assign(keyframes, false);
  for (const int k : problem.chain_starts) {
    priors_[k] += WeakPrior() + damping * SmallSteps();
    has_prior_[k] = true;
  }
  for (const int k : problem.gauge_keyframes) {
    priors_[k] += GaugePrior((*keyframes_)[k]);
    has_prior_[k] = true;
  }
  view_begin_.assign(keyframes * cameras + 2, 0);
}

void LinearSystem::PlaceLandmarks(
    const std::vector<ScreenedLandmark>& landmarks) {
  points_.resize(4 * landmarks.size());
  places_.clear();
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    LandmarkPlace place = landmarks[i].place;
    place.inverse_depth.z() = UsedInverseDepth(place);
    Eigen::Vector4d::Map(&points_[4 * i]) = place.Homogeneous();
    places_.push_back(place);
  }
}

// Collects all used observations, by landmark, and sorts them by view.
void LinearSystem::SortByView(const CalibrationProblem& problem,
                              const std::vector<ScreenedLandmark>& landmarks) {
  const int cameras = static_cast<int>(camera_sizes_.size());
  seen_.clear();
  seen_begin_.assign(1, 0);
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const Track& track = problem.tracks[landmarks[i].track];
    for (const UsedObservation& used : landmarks[i].used) {
      const TrackObservation& o = track.observations[used.index];
      seen_.push_back({.view = o.keyframe * cameras + o.camera,
                       .landmark = static_cast<int>(i),
                       .piece = PieceOf(track, used.index),
                       .z_px = o.z_px,
                       .share = landmarks[i].weight * used.weight});
    }
    seen_begin_.push_back(static_cast<int>(seen_.size()));
  }
  for (const Seen& seen : seen_) ++view_begin_[seen.view + 2];
  for (std::size_t v = 2; v < view_begin_.size(); ++v) {
    view_begin_[v] += view_begin_[v - 1];
  }
  by_view_.resize(seen_.size());
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    by_view_[view_begin_[seen_[i].view + 1]++] = static_cast<int>(i);
  }
}

template <typename Keep>
ObservationRun LinearSystem::Gather(int view, const Keep& keep) {
  landmarks_of_view_.clear();
  seen_of_view_.clear();
  z_px_.clear();
  for (int i = view_begin_[view]; i < view_begin_[view + 1]; ++i) {
    const Seen& seen = seen_[by_view_[i]];
    if (!keep(seen)) continue;
    seen_of_view_.push_back(by_view_[i]);
    landmarks_of_view_.push_back(seen.landmark);
    z_px_.push_back(seen.z_px.x());
    z_px_.push_back(seen.z_px.y());
  }
  const int cameras = static_cast<int>(camera_sizes_.size());
  return {&(*keyframes_)[view / cameras],
          &theta_->cameras[view % cameras],
          static_cast<int>(seen_of_view_.size()),
          landmarks_of_view_.data(),
          z_px_.data(),
          motions_->At(view / cameras, view % cameras)};
}

void LinearSystem::Weigh(const RobustLoss* loss) {
  const double inverse_sigma = 1 / rig_->pixel_sigma_px;
  for (int view = 0; view + 2 < static_cast<int>(view_begin_.size()); ++view) {
    const ObservationRun run = Gather(view, [](const Seen&) { return true; });
    squares_px2_.resize(std::max<std::size_t>(squares_px2_.size(), run.count));
    reprojection_.Squares(run, points_.data(), squares_px2_.data());
    for (int i = 0; i < run.count; ++i) {
      Seen& seen = seen_[seen_of_view_[i]];
      const double s = squares_px2_[i] * inverse_sigma * inverse_sigma;
      if (!(s >= 0)) continue;  // does not project
      const double weight = loss != nullptr ? loss->Weight(s) : 1;
      if (weight < kLeastWeight) continue;
      seen.weight = std::sqrt(seen.share * weight) * inverse_sigma;
      seen.square = seen.share * weight * s;
    }
  }
}

// Adds the unknowns from `place` in the interface to the kept unknowns of a
// chain.
int LinearSystem::KeepInChain(int place, int size, Chain* chain) {
  const int kept = static_cast<int>(chain->interface.size());
  for (int i = 0; i < size; ++i) chain->interface.push_back(place + i);
  return kept;
}

// Adds a piece of a track, without its observations of zero weight.
void LinearSystem::AddPiece(int landmark, std::span<Seen> piece, Chain* chain) {
  const int cameras = static_cast<int>(camera_sizes_.size());
  for (Seen& seen : piece) {
    if (seen.weight == 0) continue;
    seen.factor = static_cast<int>(chain->track_keyframes.size());
    chain->track_keyframes.push_back(seen.view / cameras - chain->range.begin);
  }
  const int place = interface_of_landmark_[landmark];
  int kept = kNone;
  if (place != kNone) {
    kept = !chain->landmarks.empty() && chain->landmarks.back() == landmark
               ? chain->kept_landmarks.back()
               : KeepInChain(place, 3, chain);
  }
  chain->tracks.push_back(static_cast<int>(chain->track_keyframes.size()));
  chain->landmarks.push_back(landmark);
  chain->kept_landmarks.push_back(kept);
}

// Finds the tracks of each chain, of landmarks with enough observations.
void LinearSystem::FindTracks() {
  const int cameras = static_cast<int>(camera_sizes_.size());
  interface_of_landmark_.assign(seen_begin_.size() - 1, kNone);
  for (std::size_t m = 0; m + 1 < seen_begin_.size(); ++m) {
    const std::span<Seen> track(seen_.data() + seen_begin_[m],
                                seen_begin_[m + 1] - seen_begin_[m]);
    int held = 0;
    int first = kNone,
        last = kNone;  // pieces with observations of nonzero weight
    for (const Seen& seen : track) {
      if (seen.weight == 0) continue;
      ++held;
      last = seen.piece;
      if (first == kNone) first = last;
    }
    if (held < kMinObservations) continue;
    if (first != last) {
      interface_of_landmark_[m] = interface_size_;
      interface_size_ += 3;
    }
    for (std::size_t begin = 0; begin < track.size();) {
      std::size_t end = begin + 1;
      while (end < track.size() && track[end].piece == track[begin].piece) {
        ++end;
      }
      const std::span<Seen> piece = track.subspan(begin, end - begin);
      if (std::any_of(piece.begin(), piece.end(), [](const Seen& seen) {
            return seen.weight > 0;
          })) {
        const int chain = chain_of_keyframe_[piece.front().view / cameras];
        AddPiece(static_cast<int>(m), piece, &chains_[chain]);
      }
      begin = end;
    }
  }
}

void LinearSystem::KeepWalks(const CalibrationProblem& problem) {
  const std::vector<KeyframeState>& x = *keyframes_;
  motion_squares_ = 0;
  for (std::size_t i = 0; i < problem.bias_links.size(); ++i) {
    const BiasLink& link = problem.bias_links[i];
    const int index = static_cast<int>(i);
    Chain& before = chains_[chain_of_keyframe_[link.before]];
    Chain& after = chains_[chain_of_keyframe_[link.after]];
    const auto half = [&](double sign_of_bias) {
      return HalfWalk(link, x[link.before], x[link.after], sign_of_bias);
    };
    before.walk_out = {
        index, KeepInChain(interface_size_, 6, &before), half(-1)};
    after.walk_in = {index, KeepInChain(interface_size_, 6, &after), half(1)};
    motion_squares_ += 2 * after.walk_in.rows.residual.squaredNorm();
    interface_size_ += 6;
  }
}

void LinearSystem::AddViews(Chain* chain) {
  const int cameras = static_cast<int>(camera_sizes_.size());
  for (int view = chain->range.begin * cameras;
       view < chain->range.end * cameras;
       ++view) {
    const ObservationRun run =
        Gather(view, [](const Seen& seen) { return seen.factor != kNone; });
    if (run.count == 0) continue;
    weights_.clear();
    factors_.clear();
    for (const int i : seen_of_view_) {
      weights_.push_back(seen_[i].weight);
      factors_.push_back(seen_[i].factor);
    }
    const int camera = view % cameras;
    const std::size_t size = static_cast<std::size_t>(2) *
                             (run.count + kPanelPad) *
                             RowsStride(camera_sizes_[camera]);
    if (rows_.size() < size) rows_.resize(size);
    reprojection_.Linearise(run,
                            points_.data(),
                            rig_->pixel_sigma_px,
                            weights_.data(),
                            rows_.data());
    const auto turn = PoseTurn(run);
    chain->elimination.AddObservations(view / cameras - chain->range.begin,
                                       camera,
                                       rows_.data(),
                                       factors_,
                                       turn ? &*turn : nullptr);
  }
}

}  // namespace selfcal
