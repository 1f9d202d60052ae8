#include "client/cli/motion_advice.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/text/text.h"
#include "core/model/parameter_blocks.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using CalibrationService = v1::CalibrationService::StubInterface;

// Directions that are listed for a lesson; the least known come first.
constexpr int kShown = 3;

std::string PercentText(double part) {
  const double percent = 100 * part;
  return percent < 10 ? fmt::format("{:.1f} %", percent)
                      : fmt::format("{:.0f} %", percent);
}

using Missing = v1::AdviseMotionResponse::MissingDirection;

// Returns true if segments of other temperatures would teach a direction.
bool IsOfTemperature(const Missing& missing) {
  const auto& parts = missing.parts();
  return std::any_of(parts.begin(), parts.end(), [](const auto& part) {
    return part.component().find(kSlopeSuffix) != std::string::npos;
  });
}

// The directions whose lesson this motion is; "" for those without one, which
// are `of_temperature` or not.
std::string DirectionLines(const v1::AdviseMotionResponse& response,
                           const std::string& motion,
                           bool of_temperature = false) {
  std::string text;
  int count = 0;
  for (const auto& missing : response.missing()) {
    if (missing.motion() != motion) continue;
    if (motion.empty() && IsOfTemperature(missing) != of_temperature) continue;
    if (++count > kShown) continue;
    text += fmt::format(
        "    {}: {}", missing.words(), PercentText(missing.sigma_by_prior()));
    if (!motion.empty()) {
      text += " -> " + PercentText(missing.sigma_by_prior_after());
    }
    text += "\n";
  }
  if (count > kShown) {
    text += fmt::format("    and {} more\n", count - kShown);
  }
  return text;
}

}  // namespace

grpc::Status AskForAdvice(Context* context,
                          const std::string& rig,
                          int top,
                          v1::AdviseMotionResponse* response) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::AdviseMotionRequest request;
  request.set_parent(RigName(rig));
  request.set_max_advice(top);
  return Call<CalibrationService>(
      stub.get(), &CalibrationService::AdviseMotion, request, response);
}

std::string GainText(double gain_nats) {
  return fmt::format("{:.2f}", gain_nats);
}

std::string MissingText(const v1::AdviseMotionResponse& response) {
  if (response.missing().empty() && response.lessons().empty()) {
    std::string text = "no direction is missing";
    if (!response.advice().empty()) {
      const auto& best = response.advice(0);
      text += fmt::format("; {:g} s of this would add most, {} nat: {}",
                          response.segment_seconds(),
                          GainText(best.gain_nats()),
                          best.instruction());
    }
    return text + "\n";
  }
  std::string text =
      response.missing().empty()
          ? "no direction is missing, but there are too few segments to "
            "confirm a calibration:\n"
          : fmt::format(
                "{} missing; in percent of the uncertainty before any "
                "recording:\n",
                CountText(
                    response.missing_size(), "direction is", "directions are"));
  for (const auto& lesson : response.lessons()) {
    text += fmt::format("  record {:g} s more of this: {}\n",
                        lesson.seconds(),
                        lesson.instruction());
    text += DirectionLines(response, lesson.motion());
  }
  const std::string slopes = DirectionLines(response, "", true);
  if (!slopes.empty()) {
    text += "  record at temperatures 20 K or more apart for this:\n" + slopes;
  }
  if (const std::string rest = DirectionLines(response, ""); !rest.empty()) {
    text += "  no motion teaches this: hold it fixed, or state it better:\n";
    text += rest;
  }
  return text;
}

}  // namespace selfcal::client
