// Rank of a block of information in units of the prior, and descriptions of the
// directions in which the data has less information than the prior (section 4
// of the method). Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/information/segment_information.h"

namespace selfcal {

struct Observability {
  int rank = 0;  // directions with an information of at least 1
  std::vector<UnobservedDirection> unobserved;
};

// `information` is k x k, symmetric, in units of the prior's sigmas: 1 is as
// much information as the prior has. `names` are its k components. The
// unobserved directions are an orthonormal basis of the span of the
// eigenvectors with an eigenvalue below 1, rotated so that each is as close to
// one component as possible: if several directions are equally unknown, single
// eigenvectors are arbitrary mixtures, and this basis is not. Their ratio is
// d^T information d.
Observability AnalyseObservability(const Eigen::MatrixXd& information,
                                   std::span<const std::string> names);

// Returns the parts of a unit vector, largest first, up to 90 % of its squared
// norm; the sign is such that the largest is positive.
UnobservedDirection DescribeDirection(const Eigen::VectorXd& direction,
                                      std::span<const std::string> names,
                                      double information_ratio);

}  // namespace selfcal
