#include "core/coach/advise.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/coach/words.h"
#include "core/information/rig_components.h"
#include "core/information/unobserved.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

double HalfLogDet(const Eigen::MatrixXd& matrix) {
  return Eigen::LLT<Eigen::MatrixXd>(matrix)
      .matrixLLT()
      .diagonal()
      .array()
      .log()
      .sum();
}

Eigen::MatrixXd Inverse(const Eigen::MatrixXd& matrix) {
  const Eigen::LLT<Eigen::MatrixXd> llt(matrix);
  if (llt.info() != Eigen::Success) {
    return Eigen::MatrixXd::Constant(
        matrix.rows(), matrix.cols(), std::numeric_limits<double>::quiet_NaN());
  }
  const Eigen::MatrixXd inverse =
      llt.solve(Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()));
  return 0.5 * (inverse + inverse.transpose());
}

// A covariance of the free components in units of the reference sigmas, and the
// log determinants whose differences are the gains.
struct Knowledge {
  Eigen::MatrixXd covariance;
  double half_log_det = 0;
  std::vector<double> groups;  // half_log_det of each block
};

class Coach {
 public:
  explicit Coach(const Rig& rig)
      : components_(rig),
        tangent_(TangentComponents(rig.factory)),
        reference_(ReferenceSigmas(rig)(components_.free())) {}

  Eigen::MatrixXd Normalised(const Eigen::MatrixXd& Lambda) const {
    return reference_.asDiagonal() *
           Lambda(components_.free(), components_.free()) *
           reference_.asDiagonal();
  }

  Knowledge Summarise(const Eigen::MatrixXd& information) const {
    Knowledge result;
    result.covariance = Inverse(information);
    result.half_log_det = HalfLogDet(result.covariance);
    for (const RigComponents::Group& group : components_.groups()) {
      result.groups.push_back(
          HalfLogDet(result.covariance(group.at, group.at)));
    }
    return result;
  }

  Advice Compare(const MotionPrediction& motion,
                 const Knowledge& now,
                 const Knowledge& after) const {
    Advice advice;
    advice.motion = motion.motion;
    advice.instruction = motion.instruction;
    advice.gain_nats = std::max(0.0, now.half_log_det - after.half_log_det);
    for (std::size_t q = 0; q < now.groups.size(); ++q) {
      advice.groups.push_back({components_.groups()[q].name,
                               std::max(0.0, now.groups[q] - after.groups[q])});
    }
    for (Eigen::Index i = 0; i < reference_.size(); ++i) {
      const TangentComponent& component = tangent_[components_.free()[i]];
      advice.sigmas.push_back(
          {component.name,
           component.unit,
           reference_[i] * std::sqrt(now.covariance(i, i)),
           reference_[i] * std::sqrt(after.covariance(i, i))});
    }
    return advice;
  }

  std::vector<WeakDirection> Weakest(const Knowledge& now) const {
    const SymmetricEigen eigen(now.covariance);
    std::vector<WeakDirection> weakest;
    const auto size = now.covariance.rows();
    const auto count = std::min<Eigen::Index>(size, kWeakestDirections);
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index at = size - 1 - k;
      UnobservedDirection direction = DescribeDirection(
          eigen.eigenvectors().col(at), components_.free_names(), 0);
      weakest.push_back({DirectionInWords(direction),
                         std::move(direction.parts),
                         std::sqrt(eigen.eigenvalues()[at])});
    }
    return weakest;
  }

 private:
  const RigComponents components_;
  const std::vector<TangentComponent> tangent_;
  const Eigen::VectorXd reference_;  // sigmas of the free components
};

}  // namespace

Coaching Advise(const Rig& rig,
                const Predictions& predictions,
                const Eigen::MatrixXd& known) {
  const Coach coach(rig);
  const Eigen::MatrixXd information = coach.Normalised(known);
  const Knowledge now = coach.Summarise(information);
  Coaching coaching;
  for (const MotionPrediction& motion : predictions.motions) {
    const Knowledge after =
        coach.Summarise(information + coach.Normalised(motion.Lambda));
    coaching.advice.push_back(coach.Compare(motion, now, after));
  }
  std::stable_sort(coaching.advice.begin(),
                   coaching.advice.end(),
                   [](const Advice& a, const Advice& b) {
                     return a.gain_nats > b.gain_nats;
                   });
  coaching.weakest = coach.Weakest(now);
  return coaching;
}

Eigen::MatrixXd KnownInformation(const Rig& rig,
                                 const Calibration& theta,
                                 const Eigen::MatrixXd& covariance,
                                 std::span<const SegmentInformation> since) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = covariance.diagonal()(free).cwiseSqrt();
  const Eigen::VectorXd weights = sigmas.cwiseInverse();
  Eigen::MatrixXd known =
      Eigen::MatrixXd::Zero(covariance.rows(), covariance.cols());
  known(free, free) = weights.asDiagonal() *
                      Inverse(weights.asDiagonal() * covariance(free, free) *
                              weights.asDiagonal()) *
                      weights.asDiagonal();
  for (const SegmentInformation& segment : since) {
    known += Transport(segment, theta).Lambda;
  }
  return known;
}

}  // namespace selfcal
