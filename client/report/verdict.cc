#include "client/report/verdict.h"

#include <fmt/format.h>

#include "client/text/text.h"

namespace selfcal::client {
namespace {

// A sigma that has not come down to a half of what it was: the data has said
// less than what was known before.
constexpr double kLearned = 0.5;
// What chance alone gives once in a thousand calibrations.
constexpr double kByChance = 1e-3;

void AddHeldOut(const v1::Validation::HeldOut& held_out, Verdict* verdict) {
  if (held_out.degrees() == 0) {
    verdict->kind = VerdictKind::kUntested;
    verdict->sentences.push_back(
        "No segment was held out to test it on: nothing but the fit itself "
        "speaks for it.");
    return;
  }
  verdict->sentences.push_back(fmt::format(
      "{} segments that it was not calibrated on: chi-square {:.1f} with {} "
      "degrees; so much or more comes by chance with probability {:.2g}.",
      held_out.segments(),
      held_out.chi_square(),
      held_out.degrees(),
      held_out.probability()));
  if (held_out.probability() < kByChance) {
    verdict->kind = VerdictKind::kInconsistent;
  }
}

void AddWeakness(const v1::Calibration& calibration,
                 const v1::Calibration& factory,
                 Verdict* verdict) {
  bool weak = false;
  for (const auto& direction : calibration.solver().held_constant()) {
    weak = true;
    verdict->sentences.push_back(
        "Not observed, and left as it was: " + DirectionText(direction) + ".");
  }
  for (const auto& estimate : calibration.estimates()) {
    const double before = SigmaBefore(factory, estimate.component());
    if (before <= 0 || estimate.sigma() <= kLearned * before) continue;
    weak = true;
    verdict->sentences.push_back(
        fmt::format("Hardly learned: {}, sigma {} {} of {} before.",
                    estimate.component(),
                    SigmaText(estimate.sigma()),
                    estimate.unit(),
                    SigmaText(before)));
  }
  if (weak && verdict->kind != VerdictKind::kInconsistent) {
    verdict->kind = VerdictKind::kWeak;
  }
}

}  // namespace

double SigmaBefore(const v1::Calibration& factory,
                   const std::string& component) {
  for (const auto& estimate : factory.estimates()) {
    if (estimate.component() == component) return estimate.sigma();
  }
  return 0;
}

Verdict Judge(const v1::Calibration& calibration,
              const v1::Calibration& factory) {
  Verdict verdict;
  if (!calibration.has_provenance()) {
    verdict.kind = VerdictKind::kFactory;
    verdict.sentences.push_back(
        "These are the values that the rig was created with: nothing was "
        "estimated.");
    return verdict;
  }
  if (calibration.state() == v1::Calibration::REJECTED) {
    verdict.kind = VerdictKind::kRejected;
    for (const std::string& reason : calibration.reasons()) {
      verdict.sentences.push_back(reason);
    }
    return verdict;
  }
  AddHeldOut(calibration.validation().held_out(), &verdict);
  AddWeakness(calibration, factory, &verdict);
  return verdict;
}

std::string VerdictText(VerdictKind kind) {
  switch (kind) {
    case VerdictKind::kGood:
      return "good";
    case VerdictKind::kUntested:
      return "plausible, and not tested on other segments";
    case VerdictKind::kWeak:
      return "weak in these directions";
    case VerdictKind::kInconsistent:
      return "inconsistent with segments it was not calibrated on";
    case VerdictKind::kRejected:
      return "rejected";
    case VerdictKind::kFactory:
      return "the factory's";
  }
  return "";
}

}  // namespace selfcal::client
