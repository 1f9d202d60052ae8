// Confirmation of a candidate: by the halves of its segments, by each segment
// against the others, and by segments that it was not calibrated on.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/calibration/noise_scale.h"
#include "core/calibration/segment_agreement.h"
#include "server/pipeline/candidate_checks.h"

namespace selfcal::server {
namespace {

// With fewer degrees, chance alone could reject a candidate.
constexpr int kLeastDegrees = 50;

void CheckHalves(const CheckContext& context,
                 std::vector<ValidationCheck>* checks) {
  const AgreementTest& halves = context.result.halves;
  const double limit = context.limits.min_probability;
  if (halves.degrees == 0) {
    AddNotTested("halves",
                 limit,
                 "Calibrations on two halves of the segments could not be "
                 "compared.",
                 checks);
    return;
  }
  std::string failure;
  if (!(halves.probability >= limit)) {
    failure = fmt::format(
        "Calibrations on two halves of the segments contradict each other: "
        "chi-square {:.1f} with {} degrees (probability {:.1e}, at least "
        "{:.0e} is required). Segments are corrupted, or the device changed "
        "between them: look for those that fit worst, and send new motion.",
        halves.statistic,
        halves.degrees,
        halves.probability,
        limit);
  }
  AddResult("halves", halves.probability, limit, failure, checks);
}

// Quantiles of a normal distribution: one in a thousand, one in a hundred.
constexpr double kThousandth = 3.09;
constexpr double kHundredth = 2.33;

// The variance over its expectation that noise exceeds by chance (Wilson and
// Hilferty's approximation of the chi-square distribution).
double LargestByChance(int degrees, double quantile) {
  if (degrees == 0) return 0;
  const double variance = 2 / (9.0 * degrees);
  return std::pow(1 - variance + quantile * std::sqrt(variance), 3);
}

bool OfImuReadings(NoiseKind kind) {
  if (kind == NoiseKind::kPixel) return false;
  const NoiseKind first = OfFirstImu(kind);
  return first == NoiseKind::kGyro || first == NoiseKind::kAccel;
}

// True if the readings of an IMU err by much more than the rig states. Noise
// may be stated wrongly, but an error that is no noise looks the same.
bool ReadingsErrMore(const CheckContext& context) {
  return std::any_of(context.result.noise_scales.begin(),
                     context.result.noise_scales.end(),
                     [&](const NoiseScale& scale) {
                       return OfImuReadings(scale.kind) && scale.determined() &&
                              scale.used > context.limits.max_plain_imu_noise;
                     });
}

double MaxDisagreement(const CheckContext& context, int degrees) {
  if (ReadingsErrMore(context)) return LargestByChance(degrees, kHundredth);
  return std::max(context.limits.max_disagreement,
                  LargestByChance(degrees, kThousandth));
}

// Sums the tests of each segment against all others. If the squares exceed
// their expectation by this much, there are errors other than noise, and their
// part that is common to all segments would go unnoticed.
void CheckDisagreement(const CheckContext& context,
                       std::vector<ValidationCheck>* checks) {
  double squares = 0;
  int degrees = 0;
  for (const SegmentFit& fit : context.result.segment_fits) {
    if (!fit.excluded.empty()) continue;
    squares += fit.others.statistic;
    degrees += fit.others.degrees;
  }
  const double limit = MaxDisagreement(context, degrees);
  if (degrees < kLeastDegrees) {
    AddNotTested("disagreement",
                 limit,
                 "Too little is known by several segments to compare them.",
                 checks);
    return;
  }
  const double excess = squares / degrees;
  std::string failure;
  if (!(excess <= limit)) {
    failure = fmt::format(
        "The segments contradict one another by {:.2f} times the variance that "
        "noise explains, over {} degrees; at most {:.2f} is noise. Something "
        "that is not modelled acts on all of them: look at the timestamps, at "
        "lost "
        "samples, at the camera model and at the noise that is stated.",
        excess,
        degrees,
        limit);
  }
  AddResult("disagreement", excess, limit, failure, checks);
}

// Segments without data that the fusion compares with the candidate, at its
// own theta.
void CheckRemembered(const CheckContext& context,
                     std::vector<ValidationCheck>* checks) {
  const RememberedUse& use = context.result.remembered;
  if (use.compared < kLeastToAgree) return;  // they have no majority
  const double limit = context.limits.max_contradicting;
  const double share = static_cast<double>(use.contradicting) / use.compared;
  std::string failure;
  if (!(share <= limit)) {
    failure = fmt::format(
        "{} of {} segments whose data is gone contradict it: some of them or "
        "of the segments of the run are corrupted or of another device, or "
        "the device has changed. Send new motion; quarantine a session that "
        "is wrong (selfcal segment quarantine).",
        use.contradicting,
        use.compared);
  }
  AddResult("remembered", share, limit, failure, checks);
  const AgreementTest& together = use.agreement;
  if (failure.empty() && together.degrees > 0 &&
      together.probability < context.limits.min_probability) {
    checks->back().sentence = fmt::format(
        "The segments whose data is gone contradict it together: chi-square "
        "{:.1f} with {} degrees (probability {:.1e}). It does not use them.",
        together.statistic,
        together.degrees,
        together.probability);
  }
}

void CheckHeldOut(const CheckContext& context, StoredValidation* validation) {
  const StoredCalibration& active = context.evidence.active;
  const double limit = context.limits.min_probability;
  const HeldOutTest test = TestHeldOut(context.rig,
                                       {context.result.theta,
                                        context.result.covariance,
                                        context.result.track_noise_factor},
                                       {active.theta, active.covariance},
                                       context.evidence.held_out);
  validation->held_out = test;
  if (test.candidate.degrees == 0) {
    const int all = test.segments + test.left_out;
    AddNotTested(
        "held_out_probability",
        limit,
        all == 0
            ? "No segment was held out to test it on."
            : fmt::format("None of the {} segments that were held out could "
                          "be tested.",
                          all),
        &validation->checks);
    return;
  }
  std::string failure;
  if (!(test.candidate.probability >= limit)) {
    failure = fmt::format(
        "{} held-out segments do not fit it: chi-square {:.1f} with {} degrees "
        "(probability {:.1e}, at least {:.0e} is required); to active version "
        "{} they fit with {:.1f}. Segments of the run are corrupted or of "
        "another device, or the device has changed: send new motion.",
        test.segments,
        test.candidate.statistic,
        test.candidate.degrees,
        test.candidate.probability,
        limit,
        active.version,
        test.active.statistic);
  }
  AddResult("held_out_probability",
            test.candidate.probability,
            limit,
            failure,
            &validation->checks);
}

}  // namespace

void CheckConfirmation(const CheckContext& context,
                       StoredValidation* validation) {
  CheckHalves(context, &validation->checks);
  CheckDisagreement(context, &validation->checks);
  CheckRemembered(context, &validation->checks);
  CheckHeldOut(context, validation);
  const int tests = (context.result.halves.degrees > 0 ? 1 : 0) +
                    (validation->held_out.candidate.degrees > 0 ? 1 : 0);
  AddResult("confirmed",
            tests,
            1,
            tests > 0
                ? ""
                : "Nothing confirms it except its own fit: neither halves "
                  "of its segments nor held-out segments could be "
                  "tested. Send more motion, so that there are segments "
                  "to test it on.",
            &validation->checks);
}

}  // namespace selfcal::server
