// Rank of a block of information in units of the prior, and names for the
// directions in which the data says less than was known before it (section 4 of
// the method). Pure, deterministic, any thread.
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

// `information` is k x k, symmetric, in units of the prior's sigmas: 1 says as
// much as the prior does. `names` are its k components. The unobserved
// directions are an orthonormal basis of the span of the eigenvectors with an
// eigenvalue below 1, turned so that each lies as close to one component as it
// can: where several directions are equally unknown, single eigenvectors are
// arbitrary mixtures, and this basis is not. Their ratio is d^T information d.
Observability AnalyseObservability(const Eigen::MatrixXd& information,
                                   std::span<const std::string> names);

// The parts of a unit vector, largest first, up to 90 % of its square; turned
// so that the largest is positive.
UnobservedDirection DescribeDirection(const Eigen::VectorXd& direction,
                                      std::span<const std::string> names,
                                      double information_ratio);

}  // namespace selfcal
