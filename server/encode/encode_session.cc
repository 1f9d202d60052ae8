#include "server/encode/encode_session.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/information/fusion.h"
#include "proto/resource_names.h"
#include "server/encode/set_time.h"

namespace selfcal::server {

v1::Session Encode(const std::string& rig, const SessionSummary& session) {
  v1::Session message;
  message.set_name(ChildName(rig, "sessions", session.session));
  message.set_session(session.session);
  message.set_segments(session.segments);
  SetTime(session.first_receive_ns, message.mutable_first_receive_time());
  SetTime(session.last_receive_ns, message.mutable_last_receive_time());
  return message;
}

v1::TrajectorySegment Encode(const std::string& rig,
                             const SessionSegment& segment,
                             int max_points) {
  v1::TrajectorySegment message;
  message.set_segment(SegmentName(rig, segment.key));
  message.set_scored(segment.state == SegmentState::kScored);
  message.set_has_data(segment.has_data);
  message.set_start_ns(segment.start_ns);
  message.set_end_ns(segment.end_ns);
  const int all = static_cast<int>(segment.path.size());
  const int points = std::min(all, max_points);
  for (int k = 0; k < points; ++k) {
    const PathPoint& point =
        segment.path[points == 1 ? 0 : k * (all - 1) / (points - 1)];
    message.add_seconds(point.seconds);
    for (const float x : point.p_GI) message.add_positions_m(x);
  }
  for (const SessionSegment::Score& score : segment.scores) {
    v1::TrajectorySegment::Score* added = message.add_scores();
    added->set_group(score.group);
    added->set_entropy_nats(score.entropy);
    added->set_gain_nats(score.gain);
  }
  for (const std::string& table : segment.tables) message.add_tables(table);
  return message;
}

v1::SegmentInformation Encode(const Rig& rig,
                              const SegmentInformation& information) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const FusedEstimate alone = Fuse(rig, std::span(&information, 1));
  v1::SegmentInformation message;
  for (const int i : FreeComponents(rig)) {
    v1::SegmentInformation::Component* added = message.add_components();
    added->set_component(components[i].name);
    added->set_unit(components[i].unit);
    added->set_prior_sigma(prior(i));
    added->set_sigma(std::sqrt(alone.covariance(i, i)));
  }
  return message;
}

namespace {

void Encode(const std::vector<IntervalResidual>& intervals,
            v1::SegmentResiduals::Intervals* message) {
  for (const IntervalResidual& interval : intervals) {
    for (int j = 0; j < interval.residual.size(); ++j) {
      message->add_residual(interval.residual[j]);
      message->add_whitened(interval.whitened[j]);
    }
  }
}

}  // namespace

v1::SegmentResiduals Encode(const SegmentResiduals& residuals,
                            const MotionSegment& segment,
                            int cameras) {
  v1::SegmentResiduals message;
  for (int k = 0; k < cameras; ++k) message.add_cameras()->set_camera(k);
  for (std::size_t i = 0; i < residuals.observations.size(); ++i) {
    const ObservationResidual& o = residuals.observations[i];
    auto& camera = *message.mutable_cameras(segment.observations[i].camera);
    for (const double x : o.residual_px) {
      message.add_residual_px(static_cast<float>(x));
    }
    camera.set_observations(camera.observations() + 1);
    if (o.inlier) {
      camera.set_inliers(camera.inliers() + 1);
      // Accumulates the sum of squares first.
      camera.set_inlier_rms_px(camera.inlier_rms_px() +
                               o.residual_px.squaredNorm());
      continue;
    }
    message.add_unused(static_cast<int>(i));
    if (!o.projects) message.add_not_projectable(static_cast<int>(i));
  }
  for (auto& camera : *message.mutable_cameras()) {
    camera.set_inlier_rms_px(
        std::sqrt(camera.inlier_rms_px() / std::max(1, camera.inliers())));
  }
  Encode(residuals.intervals, message.mutable_intervals());
  message.set_reprojection_median_px(
      residuals.statistics.reprojection_median_px);
  for (const double rms : residuals.statistics.inertial_rms) {
    message.add_inertial_rms(rms);
  }
  if (residuals.second_intervals.empty()) return message;
  Encode(residuals.second_intervals, message.mutable_imu1_intervals());
  for (const double rms : residuals.statistics.second_inertial_rms) {
    message.add_imu1_inertial_rms(rms);
  }
  return message;
}

}  // namespace selfcal::server
