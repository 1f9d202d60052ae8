#include "server/pipeline/verification.h"

#include <fmt/format.h>

#include <algorithm>

namespace selfcal::server {
namespace {

// The largest difference as a multiple of what rounding explains.
double Excess(const ScoreDifference& difference) {
  return std::max({difference.entropy_nats,
                   difference.information,
                   difference.estimate_sigmas}) /
         difference.tolerance;
}

std::string FindingOf(const CalibrationCheck& check) {
  const ResultDifference& by = check.difference;
  return fmt::format(
      "The two cores disagree on this calibration: {} by {:.3g} sigma, the "
      "sigma of {} by {:.3g} %.",
      by.theta_component,
      by.theta_sigmas,
      by.sigma_component,
      100 * by.sigma);
}

std::string FindingOf(const std::vector<ScoreCheck>& checks) {
  const ScoreCheck* worst = nullptr;
  int differing = 0;
  for (const ScoreCheck& check : checks) {
    if (check.outcome != VerificationOutcome::kDiffers) continue;
    ++differing;
    if (worst == nullptr ||
        Excess(check.difference) > Excess(worst->difference)) {
      worst = &check;
    }
  }
  if (worst == nullptr) return "";
  return fmt::format(
      "The two cores disagree on the score of {} of {} segments, most on that "
      "of {}~{}: {:.3g} nat, information by {:.3g}, estimate by {:.3g} sigma.",
      differing,
      checks.size(),
      worst->segment.session,
      worst->segment.index,
      worst->difference.entropy_nats,
      worst->difference.information,
      worst->difference.estimate_sigmas);
}

}  // namespace

std::string DisagreementText(const Verification& verification) {
  std::string finding = FindingOf(verification.scores);
  const auto& calibration = verification.calibration;
  if (!calibration || calibration->outcome != VerificationOutcome::kDiffers) {
    return finding;
  }
  return finding.empty() ? FindingOf(*calibration)
                         : FindingOf(*calibration) + " " + finding;
}

}  // namespace selfcal::server
