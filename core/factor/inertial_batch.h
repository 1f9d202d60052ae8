// The inertial factors of many links between keyframes, several at a time in
// the lanes of the machine's vectors, in the form that the elimination of a
// chain of keyframes needs: solved for the earlier state.
//
// The factor r + J0 x0 + J1 x1 + Jt theta of inertial.h, whose covariance is
// U U^T with U upper triangular, equals U e with e of unit covariance. J0 is
// invertible, and
//
//   x0 = A e + G z,   A = J0^-1 U,   G = -J0^-1 [Jt | J1 motion | r | J1 pose]
//
// with z = (theta_i 15, velocity and biases of the later state 9, 1, its pose
// 6). The same numbers as EvaluateInertial gives, to rounding.
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

// U, in the order of the residual: U^-1 is SquareRootInformation of its
// covariance. Where that is singular to rounding, pivots are raised to 1e-14 of
// their variance.
struct InertialNoiseRoot {
  double motion[9][9];  // upper triangular
  double motion_by_bias[9][6];
  double bias[6];  // diagonal
};

// The arguments of EvaluateInertial that differ from link to link.
struct InertialLinkStates {
  const KeyframeState* x0;
  const KeyframeState* x1;
  std::span<const ImuSample> samples;
};

// A workspace: keeps its memory from call to call. Not for use by two threads
// at once. Results do not depend on which links stand beside each other by more
// than rounding, and are the same at every call.
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

  // The same with noise as it was found elsewhere.
  void LineariseWithRoots(std::span<const InertialLinkStates> links,
                          const ImuCalibration& imu,
                          double gravity_mps2,
                          std::span<const InertialNoiseRoot> roots,
                          std::span<InertialTransition> out);

  // U^-1 r alone.
  void Residuals(std::span<const InertialLinkStates> links,
                 const ImuCalibration& imu,
                 double gravity_mps2,
                 std::span<const InertialNoiseRoot> roots,
                 std::span<InertialResidual> whitened);

 private:
  struct alignas(64) Chunk {
    double values[8];
  };
  // All chunks as one row of numbers.
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

  // Lays the readings of W links side by side, and their noise unless null;
  // returns the number of rows.
  template <int W>
  int GatherReadings(std::span<const InertialLinkStates> links,
                     const ImuNoise* noise);

  VectorWidth width_;
  std::vector<Chunk> readings_, densities_;
  InertialTransition unused_transition_;  // of lanes without a link
  InertialNoiseRoot unused_root_;
};

}  // namespace selfcal
