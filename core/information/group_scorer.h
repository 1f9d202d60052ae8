// Scores that follow from the information about theta alone. A workspace: it
// allocates nothing for a rig whose groups have the sizes of the last one, if
// every direction is observed.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/information/rig_components.h"
#include "core/information/segment_information.h"
#include "core/information/unobserved.h"

namespace selfcal {

// Cholesky factorisation of symmetric positive definite matrices of one size.
class DefiniteMatrix {
 public:
  // Returns false if the matrix is not positive definite; the other functions
  // must then not be called.
  template <class Matrix>
  bool Factor(const Matrix& matrix) {
    llt_.compute(matrix);
    return llt_.info() == Eigen::Success;
  }
  // 1/2 ln det.
  double HalfLogDet() const {
    return llt_.matrixLLT().diagonal().array().log().sum();
  }
  const Eigen::MatrixXd& Inverse();
  // x^T A^-1 x.
  double InverseSquare(const Eigen::VectorXd& x) {
    whitened_ = x;
    llt_.matrixL().solveInPlace(whitened_);
    return whitened_.squaredNorm();
  }

 private:
  Eigen::LLT<Eigen::MatrixXd> llt_;
  Eigen::MatrixXd inverse_, symmetric_;
  Eigen::VectorXd whitened_;
};

class GroupScorer {
 public:
  // `information` is that of the free components in units of the prior,
  // symmetric and positive semidefinite.
  void Score(const RigComponents& components,
             const Eigen::MatrixXd& information,
             std::vector<GroupScore>* scores);

  // Analyses the observability of a block of such information: as
  // AnalyseObservability, but without its cost if every direction is observed.
  void Observe(const Eigen::MatrixXd& information,
               std::span<const std::string> names,
               int* rank,
               std::vector<UnobservedDirection>* unobserved,
               DefiniteMatrix* workspace);

 private:
  struct GroupWorkspace {
    Eigen::MatrixXd covariance;
    DefiniteMatrix posterior;
    Eigen::MatrixXd gained;
    DefiniteMatrix observed;
  };

  DefiniteMatrix posterior_;
  std::vector<GroupWorkspace> groups_;
};

}  // namespace selfcal
