// Inertial factors of many links between keyframes, vectorised over several
// links at a time, in the form that the elimination of a chain of keyframes
// needs: solved for the earlier state.
//
// The factor r + J0 x0 + J1 x1 + Jt theta of inertial.h, whose covariance is
// U U^T with U upper triangular, equals U e with e of unit covariance. J0 is
// invertible, and
//
//   x0 = A e + G z,   A = J0^-1 U,   G = -J0^-1 [Jt | J1 motion | r | J1 pose]
//
// with z = (theta_i, velocity and biases of the later state 9, 1, its pose 6).
// The same numbers as EvaluateInertial gives, to rounding.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/elimination/chain_transition.h"
#include "core/factor/inertial.h"
#include "core/simd/vector_width.h"

namespace selfcal {

namespace inertial {
struct TransitionTarget;
}  // namespace inertial

// A view.
struct InertialTransition : ChainTransition {
  const double* whitened;  // U^-1 r, 15, in the order of the residual
};

// Numbers that begin on a cache line.
class AlignedNumbers {
 public:
  void GrowTo(std::size_t size) {
    const std::size_t chunks = (size + kChunk - 1) / kChunk;
    if (chunks_.size() < chunks) chunks_.resize(chunks);
  }
  double* data() { return reinterpret_cast<double*>(chunks_.data()); }
  const double* data() const {
    return reinterpret_cast<const double*>(chunks_.data());
  }

 private:
  static constexpr std::size_t kChunk = 8;
  struct alignas(64) Chunk {
    double values[kChunk];
  };
  std::vector<Chunk> chunks_;
};

// The transitions of several links.
class InertialTransitions {
 public:
  // Forgets all, and makes room; the memory is reused.
  void Start(std::size_t count, int link_size);

  std::size_t size() const { return count_; }
  InertialTransition operator[](std::size_t i) const {
    const double* G = numbers_.data() + i * Stride();
    return {{columns_, G, G + GSize()}, G + GSize() + kASize};
  }

 private:
  friend class InertialBatch;

  static constexpr int kASize = kChainStateSize * kTransitionNoise;
  static constexpr int kWhitenedSize = WholeVectors(kChainStateSize);
  std::size_t GSize() const {
    return static_cast<std::size_t>(kChainStateSize) * columns_.stride;
  }
  std::size_t Stride() const { return GSize() + kASize + kWhitenedSize; }

  TransitionColumns columns_ = TransitionColumns(0);
  std::size_t count_ = 0;
  AlignedNumbers numbers_;  // of each G, A and the whitened residual
};

// U, in the order of the residual: U^-1 is the SquareRootInformation of its
// covariance. If that is singular to rounding, pivots are raised to 1e-14 of
// their variance.
struct InertialNoiseRoot {
  double motion[9][9];  // upper triangular
  double motion_by_bias[9][6];
  double bias[6];  // diagonal
};

// Arguments of EvaluateInertial that differ between links.
struct InertialLinkStates {
  const KeyframeState* x0;
  const KeyframeState* x1;
  std::span<const ImuSample> samples;
};

// A workspace that reuses its memory. Not thread-safe. Results depend on the
// other links of a batch only by rounding, and are the same at every call.
class InertialBatch {
 public:
  explicit InertialBatch(VectorWidth width) : width_(width) {}

  // Fills roots and out for each link.
  void Linearise(std::span<const InertialLinkStates> links,
                 const ImuCalibration& imu,
                 const ImuNoise& noise,
                 double gravity_mps2,
                 std::span<InertialNoiseRoot> roots,
                 InertialTransitions* out);

  // The same with given noise.
  void LineariseWithRoots(std::span<const InertialLinkStates> links,
                          const ImuCalibration& imu,
                          double gravity_mps2,
                          std::span<const InertialNoiseRoot> roots,
                          InertialTransitions* out);

  // Computes only U^-1 r.
  void Residuals(std::span<const InertialLinkStates> links,
                 const ImuCalibration& imu,
                 double gravity_mps2,
                 std::span<const InertialNoiseRoot> roots,
                 std::span<InertialResidual> whitened);

 private:
  // Calls run.operator()<W>(kernel input, first link, number of links) for each
  // group of W links.
  template <class Function>
  void ForEachGroup(std::span<const InertialLinkStates> links,
                    const ImuCalibration& imu,
                    const ImuNoise* noise,
                    double gravity_mps2,
                    const Function& run);

  // The places at which the kernel writes W transitions of `out`.
  template <int W>
  std::array<inertial::TransitionTarget, W> Targets(std::size_t first,
                                                    std::size_t n,
                                                    InertialTransitions* out);

  // Interleaves the readings of W links, and their noise unless null; returns
  // the number of rows.
  template <int W>
  int GatherReadings(std::span<const InertialLinkStates> links,
                     const ImuNoise* noise);

  VectorWidth width_;
  AlignedNumbers readings_, densities_;
  InertialTransitions unused_transition_;  // for lanes without a link
  InertialNoiseRoot unused_root_;
};

}  // namespace selfcal
