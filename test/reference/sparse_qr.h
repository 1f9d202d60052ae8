// The paper's own way from a segment to R_theta: a sparse QR of the whole
// whitened Jacobian with theta ordered last (section IV-A), by SuiteSparseQR.
// Slow and accurate: what tests and benchmarks compare with.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/model/rig.h"
#include "test/reference/segment_jacobian.h"

namespace selfcal {

// What is left for theta: |R d + c|^2 + const. R has as many rows as the rank
// of theta that the QR finds, at most theta_size; Lambda = R^T R, eta = -R^T c.
struct ThetaRoot {
  Eigen::MatrixXd R;
  Eigen::VectorXd c;
};

enum class RankDetection {
  kDefault,  // drops columns below SuiteSparseQR's default tolerance
  kNone,     // R has as many rows as there are, at most theta_size
};

// One Jacobian. Its pattern is analysed once; it may be factorised many times.
class SparseQr {
 public:
  explicit SparseQr(const SegmentJacobian& jacobian,
                    RankDetection detection = RankDetection::kDefault);
  ~SparseQr();

  void Factorise();
  // After Factorise().
  ThetaRoot Root() const;

 private:
  struct Cholmod;
  const std::unique_ptr<Cholmod> cholmod_;
  const double tolerance_;
  const int theta_size_;
};

// H_q of every group of the rig from R_theta, in units of the prior over the
// free components, with the prior: by QR alone, never squaring R.
std::vector<double> ReferenceEntropies(const Rig& rig,
                                       const Eigen::MatrixXd& R);

// Information of the data against that of the prior along its principal
// directions, of the free components together and of every group of the rig,
// from R_theta in units of the prior: by QR and singular values alone.
struct ReferenceInformation {
  Eigen::VectorXd whole;
  std::vector<Eigen::VectorXd> groups;
};

ReferenceInformation ReferenceDirections(const Rig& rig,
                                         const Eigen::MatrixXd& R);

}  // namespace selfcal
