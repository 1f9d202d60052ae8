// Inertial factors over long and short intervals, and over lost samples: many
// devices with known truth, the normalised squared error of theta (NEES).
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "test/core/calibration/inertial_devices.h"
#include "test/evaluation/context.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kDevices = 24;
constexpr int kQuickDevices = 2;
constexpr double kProbability = 0.95;
constexpr std::uint64_t kKeyframeRateFirstSeed = 7001;

// Where the solver converged.
struct KeyframeRateOutcome {
  std::optional<double> nees;
  double worst_sigmas = 0;
};

KeyframeRateOutcome RunDevice(const InertialCase& of, std::uint64_t seed) {
  const InertialOutcome result = CalibrateInertialDevice(of, seed);
  KeyframeRateOutcome outcome;
  if (result.status != CalibrateStatus::kConverged) return outcome;
  outcome.nees = NormalisedSquaredError(result.error, result.covariance).nees;
  outcome.worst_sigmas =
      result.error.cwiseQuotient(result.covariance.diagonal().cwiseSqrt())
          .cwiseAbs()
          .maxCoeff();
  return outcome;
}

}  // namespace

void RunKeyframeRate(Context* context) {
  const std::vector<InertialCase> cases = InertialCases();
  const int devices = context->quick() ? kQuickDevices : kDevices;
  const int parameters =
      static_cast<int>(FreeComponents(HandheldRig("inertial")).size());
  ResultTable table({"case",
                     "keyframes a second",
                     "devices with an outcome",
                     "mean NEES",
                     "95 % from",
                     "to",
                     "largest error [sigma]"});
  for (const InertialCase& of : cases) {
    std::vector<KeyframeRateOutcome> outcomes(devices);
    context->ForEach(devices, [&](int i) {
      outcomes[i] =
          RunDevice(of, kKeyframeRateFirstSeed + static_cast<std::uint64_t>(i));
    });
    std::vector<double> nees;
    double worst = 0;
    for (const KeyframeRateOutcome& outcome : outcomes) {
      if (!outcome.nees) continue;
      nees.push_back(*outcome.nees);
      worst = std::max(worst, outcome.worst_sigmas);
    }
    const std::string name = "keyframe_rate." + of.name;
    const int count = static_cast<int>(nees.size());
    context->AtLeast(name + ".devices_with_outcome",
                     count,
                     0.9 * devices,
                     {.unit = "devices"});
    if (count == 0) continue;
    const auto [low, high] = NeesBounds(parameters, count, kProbability);
    context->Within(name + ".nees_mean", Mean(nees), low, high);
    table.Add({of.name,
               of.keyframe_rate_hz,
               static_cast<long>(count),
               Mean(nees),
               low,
               high,
               worst});
    context->Progress(of.name);
  }
  context->WriteTable("nees", table);
}

}  // namespace selfcal
