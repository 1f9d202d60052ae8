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
#include <span>
#include <vector>

#include "core/elimination/chain_transition.h"
#include "core/factor/inertial.h"
#include "core/simd/vector_width.h"

namespace selfcal {

struct InertialTransition : ChainTransition {
  double whitened[15];  // U^-1 r, in the order of the residual
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

  // Fills roots and out, one for each link.
  void Linearise(std::span<const InertialLinkStates> links,
                 const ImuCalibration& imu,
                 const ImuNoise& noise,
                 double gravity_mps2,
                 std::span<InertialNoiseRoot> roots,
                 std::span<InertialTransition> out);

  // The same with given noise.
  void LineariseWithRoots(std::span<const InertialLinkStates> links,
                          const ImuCalibration& imu,
                          double gravity_mps2,
                          std::span<const InertialNoiseRoot> roots,
                          std::span<InertialTransition> out);

  // Computes only U^-1 r.
  void Residuals(std::span<const InertialLinkStates> links,
                 const ImuCalibration& imu,
                 double gravity_mps2,
                 std::span<const InertialNoiseRoot> roots,
                 std::span<InertialResidual> whitened);

 private:
  struct alignas(64) Chunk {
    double values[8];
  };
  // All chunks as one array of numbers.
  static double* Numbers(std::vector<Chunk>* chunks) {
    return reinterpret_cast<double*>(chunks->data());
  }

  // Calls run.operator()<W>(kernel input, first link, number of links) for each
  // group of W links.
  template <class Function>
  void ForEachGroup(std::span<const InertialLinkStates> links,
                    const ImuCalibration& imu,
                    const ImuNoise* noise,
                    double gravity_mps2,
                    const Function& run);

  // Interleaves the readings of W links, and their noise unless null; returns
  // the number of rows.
  template <int W>
  int GatherReadings(std::span<const InertialLinkStates> links,
                     const ImuNoise* noise);

  VectorWidth width_;
  std::vector<Chunk> readings_, densities_;
  InertialTransition unused_transition_;  // for lanes without a link
  InertialNoiseRoot unused_root_;
};

}  // namespace selfcal
