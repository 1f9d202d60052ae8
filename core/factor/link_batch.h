// Inertial factors of many links between keyframes, of one IMU or of two, in
// the form that the elimination of a chain of keyframes needs.
//
// Each IMU has its factors of inertial_batch.h, the second one at the states of
// its own frame (second_imu.h). With two, a link has 30 residuals and a state
// 24 unknowns. The transitions of both,
//   x = A0 e0 + G0 z,   y = A1 e1 + G1 z,
// with the state y of the second one, whose pose is P x + M mount to first
// order and whose measured motion depends on its time offset, state its pose
// twice: C (e0, e1) + D z = 0. With C^T = Q1 R from a QR
// factorisation, and (e0, e1) = Q1 u + Q2 e, that is u = -R^-T D z: six further
// rows of unit information about z, and 24 white e. These are an orthonormal
// combination of the noise of both, so that nothing is lost or squared.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/elimination/chain_transition.h"
#include "core/factor/inertial_batch.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/simd/vector_width.h"

namespace selfcal {

inline constexpr int kMaxImus = 2;

// The same links for each IMU: the states of the keyframes, and its samples.
// The list of the second one is empty if there is none.
using LinksOfImus = std::array<std::vector<InertialLinkStates>, kMaxImus>;
using RootsOfImus = std::array<std::vector<InertialNoiseRoot>, kMaxImus>;

// The transitions of several links.
class LinkTransitions {
 public:
  std::size_t size() const { return of_imu_[0].size(); }
  ChainTransition operator[](std::size_t i) const;
  int imus() const { return imus_; }
  // U^-1 r of an IMU, 15, in the order of the residual.
  std::span<const double> Whitened(std::size_t i, int imu) const {
    return {of_imu_[imu][i].whitened, kChainStateSize};
  }
  // Posterior of e0 and e1, 15 for each IMU, from that of the noise of the
  // transition and of its rows (ChainPosterior).
  ChainNoiseVector NoiseOfImus(std::size_t i,
                               const ChainNoiseVector& noise) const;
  ChainNoiseMatrix CovarianceOfImus(std::size_t i,
                                    const ChainNoiseMatrix& covariance) const;

 private:
  friend class LinkBatch;

  static constexpr int kState = kMaxChainStateSize;
  using Rotation = Eigen::Matrix<double, kMaxChainNoise, kMaxChainNoise>;

  // The transition of a link of two IMUs.
  struct Joined {
    explicit Joined(const TransitionColumns& columns)
        : G(kState, columns.stride), H(kMaxChainLinkRows, columns.stride) {}

    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> G, H;
    Eigen::Matrix<double, kState, kState, Eigen::RowMajor> A;
    Rotation Q;  // columns Q2, Q1
  };

  int imus_ = 1;
  std::array<InertialTransitions, kMaxImus> of_imu_;
  TransitionColumns columns_ = TransitionColumns(0);
  std::vector<Joined> joined_;
};

// A workspace that reuses its memory. Not thread-safe.
class LinkBatch {
 public:
  explicit LinkBatch(VectorWidth width) : inertial_(width) {}

  // Uses the noise that the rig states.
  void Linearise(const LinksOfImus& links,
                 const Calibration& theta,
                 const Rig& rig,
                 LinkTransitions* out);

  // Uses given noise.
  void LineariseWithRoots(const LinksOfImus& links,
                          const Calibration& theta,
                          double gravity_mps2,
                          const RootsOfImus& roots,
                          LinkTransitions* out);

  // Computes only U^-1 r of one IMU.
  void Residuals(std::span<const InertialLinkStates> links,
                 const Calibration& theta,
                 int imu,
                 double gravity_mps2,
                 std::span<const InertialNoiseRoot> roots,
                 std::span<InertialResidual> whitened);

 private:
  // The links with the states of the frame of an IMU.
  std::span<const InertialLinkStates> InFrame(
      std::span<const InertialLinkStates> links,
      const Calibration& theta,
      int imu);
  // Calls linearise(links, imu) for each IMU, and joins the transitions.
  template <class Function>
  void ForEachImu(const LinksOfImus& links,
                  const Calibration& theta,
                  double gravity_mps2,
                  LinkTransitions* out,
                  const Function& linearise);

  InertialBatch inertial_;
  RootsOfImus roots_;  // those of the last Linearise()
  std::vector<KeyframeState> states_;
  std::vector<InertialLinkStates> moved_;
};

}  // namespace selfcal
