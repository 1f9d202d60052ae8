// What a visual-inertial filter reports of a simulated device: tracks instead
// of landmarks, and states at the exposures of the images.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "client/selfcal/closed_segment.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal::client {

struct FilterStep {
  KeyframeState state;  // at its exposure
  std::int64_t image_t_ns = 0;
  std::vector<KeyframeObservation> seen;  // without positions
};

struct FilterSession {
  std::vector<ImuSample> imu;
  std::vector<FilterStep> steps;
};

// Joins the segments of a session. Their states hold at the timestamps of the
// images; those of the steps hold later by the time offset of the first camera
// of theta, in between the body moves as the trajectory does.
inline FilterSession MakeFilterSession(
    const std::vector<MotionSegment>& segments,
    const Calibration& theta,
    const Trajectory& trajectory) {
  const double offset_s = theta.cameras[0].time_offset_s;
  FilterSession session;
  for (const MotionSegment& segment : segments) {
    for (const ImuSample& sample : segment.imu) {
      if (session.imu.empty() || sample.t_ns > session.imu.back().t_ns) {
        session.imu.push_back(sample);
      }
    }
    const std::size_t first = session.steps.size();
    for (const KeyframeState& x : segment.keyframes) {
      const double t_s = static_cast<double>(x.t_ns) * 1e-9;
      const BodyMotion here = trajectory.At(t_s);
      const BodyMotion there = trajectory.At(t_s + offset_s);
      // Rotation of the frame of the filter relative to the true one.
      const Eigen::Quaterniond q = x.q_GI * here.q_GI.conjugate();
      FilterStep step;
      step.image_t_ns = x.t_ns;
      step.state = x;
      step.state.t_ns += std::llround(offset_s * 1e9);
      step.state.q_GI = (q * there.q_GI).normalized();
      step.state.p_GI += q * (there.p_GI - here.p_GI);
      step.state.v_GI += q * (there.v_GI - here.v_GI);
      session.steps.push_back(step);
    }
    for (const Observation& o : segment.observations) {
      session.steps[first + static_cast<std::size_t>(o.keyframe)]
          .seen.push_back(
              {o.camera,
               segment.landmarks[static_cast<std::size_t>(o.landmark)].id,
               o.z_px});
    }
  }
  return session;
}

}  // namespace selfcal::client
