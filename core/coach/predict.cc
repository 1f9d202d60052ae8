#include "core/coach/predict.h"

#include "core/information/segment_scorer.h"
#include "core/simulation/exposures.h"

namespace selfcal {
namespace {

// Additional time for the begin of a segment and its last samples.
constexpr double kSlack_s = 0.1;

double SegmentDuration(const SimulationOptions& options) {
  return options.keyframes_per_segment / options.keyframe_rate_hz;
}

}  // namespace

MotionSegment SimulatePrimitive(const Rig& rig,
                                const Calibration& theta_true,
                                const Calibration& theta_slam,
                                const Primitive& primitive,
                                const SimulationOptions& options) {
  const double segment_s = SegmentDuration(options) + kSlack_s;
  const TimeMargins margins =
      ExposureMargins(theta_true, theta_slam, options.session_age_s, segment_s);
  const double duration_s = segment_s + margins.before_s + margins.after_s;
  const auto trajectory =
      Perform(primitive, theta_true, duration_s, options.seed);
  return Simulate(rig,
                  theta_true,
                  theta_slam,
                  *trajectory,
                  std::string(primitive.name),
                  options)
      .segments.front();
}

Predictions Predict(const Rig& rig,
                    const Calibration& theta,
                    const PredictOptions& options) {
  Predictions predictions;
  predictions.theta = theta;
  predictions.segment_s = SegmentDuration(options.simulation);
  SegmentScorer scorer;
  SegmentInformation information;
  for (const Primitive& primitive : Primitives()) {
    const MotionSegment segment =
        SimulatePrimitive(rig, theta, theta, primitive, options.simulation);
    scorer.Score(rig, theta, segment, {}, &information);
    predictions.motions.push_back(
        {primitive.name, primitive.instruction, information.Lambda});
  }
  return predictions;
}

}  // namespace selfcal
