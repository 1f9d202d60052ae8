// The estimate of a candidate compared with the prior and the active one.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/pipeline/candidate_checks.h"

namespace selfcal::server {
namespace {

// ", and 2 others" after the worst of `count`.
std::string AndOthers(int count) {
  if (count < 2) return "";
  return count == 2 ? ", and one other"
                    : fmt::format(", and {} others", count - 1);
}

// The centre of the prior, in sentences.
const char* CentreText(const Rig& rig) {
  return rig.prior_mean ? "prior mean" : "factory's value";
}

void CheckValues(const CheckContext& context,
                 std::vector<ValidationCheck>* checks) {
  const Rig& rig = context.rig;
  const double limit = context.limits.max_prior_sigmas;
  const Eigen::VectorXd change = BoxMinus(context.result.theta, PriorMean(rig));
  const Eigen::VectorXd prior = PriorSigmas(rig);
  double largest = 0;
  int worst = 0;
  int beyond = 0;
  for (const int k : FreeComponents(rig)) {
    const double sigmas = std::abs(change[k]) / prior[k];
    beyond += sigmas <= limit ? 0 : 1;
    if (!(sigmas <= largest)) {
      largest = sigmas;
      worst = k;
    }
  }
  std::string failure;
  if (beyond > 0) {
    failure = fmt::format(
        "{} is {:.1f} prior sigmas from the {}{}: at most {:.1f} "
        "are plausible. Check the tolerances (prior_sigmas); for a device "
        "that was rebuilt, create a new rig.",
        TangentComponents(rig.factory)[worst].name,
        largest,
        CentreText(rig),
        AndOthers(beyond),
        limit);
  }
  AddResult("prior_sigmas", largest, limit, failure, checks);
}

void CheckPrior(const CheckContext& context,
                std::vector<ValidationCheck>* checks) {
  if (!context.evidence.has_factory_prior) return;
  const PriorAgreement prior = CompareWithPrior(
      context.rig, context.result.theta, context.result.covariance);
  const double limit = context.limits.max_error_ratio;
  const double ratio = ErrorRatio(prior, context.limits);
  std::string failure;
  if (ratio > limit) {
    failure = fmt::format(
        "The segments contradict the prior: where they show theta, it is "
        "{:.2g} times as far from the {} as the tolerances say "
        "(probability {:.1g}). If that is so of the rest, errors are {:.2f} "
        "times as large as stated: at most {:.1f} times may become active. "
        "Check whether the {} is of such a device (selfcal cohort show), "
        "widen the tolerances (prior_sigmas, selfcal rig "
        "update), or send richer motion.",
        prior.prior_error_ratio,
        CentreText(context.rig),
        prior.probability,
        ratio,
        limit,
        context.rig.prior_mean ? "prior mean" : "factory calibration");
  }
  AddResult("prior_agreement", ratio, limit, failure, checks);
}

void CheckRank(const CheckContext& context,
               std::vector<ValidationCheck>* checks) {
  const StoredCalibration& active = context.evidence.active;
  const int before = active.report ? active.report->rank : 0;
  const auto changed = static_cast<int>(context.evidence.changed.size());
  const int least = std::max(0, before - changed);
  const int rank = context.result.rank;
  std::string failure;
  if (rank < least) {
    failure = fmt::format(
        "It estimates {} directions, and active version {} estimates {}: the "
        "segments show less than was known before. Send richer motion "
        "(selfcal rig coach says which).",
        rank,
        active.version,
        before);
  }
  AddResult("rank", rank, least, failure, checks);
}

void CheckCertainty(const CheckContext& context,
                    std::vector<ValidationCheck>* checks) {
  const StoredCalibration& active = context.evidence.active;
  const double limit = context.limits.max_sigma_growth;
  if (const auto& split = context.result.remembered.split) {
    AddNotTested(
        "sigma_growth",
        limit,
        fmt::format("The newest {} segments show another {} than those "
                    "before (probability {:.1g}): the device may have "
                    "changed, and what was known to active version {} "
                    "is in doubt.",
                    split->newer,
                    split->block == "all" ? "theta" : split->block,
                    split->probability,
                    active.version),
        checks);
    return;
  }
  const auto components = TangentComponents(context.rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(context.rig);
  const Eigen::VectorXd before = active.covariance.diagonal().cwiseSqrt();
  // The probability of a device change is not a lack of information.
  Eigen::VectorXd after = context.result.covariance.diagonal();
  const Eigen::VectorXd& change = context.result.remembered.change_sigmas;
  if (change.size() == after.size()) after -= change.cwiseAbs2();
  after = after.cwiseMax(0).cwiseSqrt().eval();
  double largest = 0;
  int worst = 0;
  int beyond = 0;
  for (const int k : FreeComponents(context.rig)) {
    if (!(before[k] < context.limits.observed_below * prior[k])) continue;
    const double growth = after[k] / before[k];
    beyond += growth <= limit ? 0 : 1;
    if (!(growth <= largest)) {
      largest = growth;
      worst = k;
    }
  }
  std::string failure;
  if (beyond > 0) {
    failure = fmt::format(
        "The sigma of {} is {:.3g} {}, that of active version {} is {:.3g}{}: "
        "at most {:.1f} times as much may become active. Send richer motion "
        "(selfcal rig coach says which).",
        components[worst].name,
        after[worst],
        components[worst].unit,
        active.version,
        before[worst],
        AndOthers(beyond),
        limit);
  }
  AddResult("sigma_growth", largest, limit, failure, checks);
}

}  // namespace

double ErrorRatio(const PriorAgreement& prior, const CandidateLimits& limits) {
  return prior.probability < limits.min_probability ? prior.error_ratio : 1;
}

void CheckEstimate(const CheckContext& context,
                   std::vector<ValidationCheck>* checks) {
  CheckValues(context, checks);
  CheckPrior(context, checks);
  CheckRank(context, checks);
  CheckCertainty(context, checks);
}

}  // namespace selfcal::server
