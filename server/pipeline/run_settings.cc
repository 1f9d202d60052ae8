#include "server/pipeline/run_settings.h"

#include <fmt/format.h>

namespace selfcal::server {
namespace {

const char* LossName(LossKind loss) {
  switch (loss) {
    case LossKind::kNone:
      return "none";
    case LossKind::kHuber:
      return "huber";
    case LossKind::kCauchy:
      return "cauchy";
  }
  return "unknown";
}

const char* YesNo(bool value) { return value ? "yes" : "no"; }

std::string PriorName(const CalibrateOptions& options, std::int64_t change) {
  if (!options.prior) return "none";
  return change > 0 ? fmt::format("what change {} leaves known", change)
                    : "given";
}

}  // namespace

std::vector<std::pair<std::string, std::string>> RunSettings(
    const CalibrateOptions& options, std::int64_t change) {
  return {
      {"loss", LossName(options.loss)},
      {"loss_scale", fmt::format("{:g}", options.loss_scale)},
      {"prior", PriorName(options, change)},
      {"max_iterations", fmt::format("{}", options.max_iterations)},
      {"correlated_tracks", YesNo(options.correlated_tracks)},
      {"noise_factors", YesNo(options.noise_scales)},
      {"reweight_noise", YesNo(options.reweight_noise)},
      {"exclude_contradictions", YesNo(options.exclude_contradictions)},
      {"merge_landmarks", fmt::format("{}", options.merge_landmarks)},
      {"solver",
       options.solver == SolverKind::kStructured ? "structured" : "ceres"},
  };
}

}  // namespace selfcal::server
