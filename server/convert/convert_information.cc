#include <utility>

#include "server/convert/convert.h"

namespace selfcal::server {

void ToProto(const Eigen::VectorXd& vector, VectorMessage* message) {
  message->Assign(vector.begin(), vector.end());
}

Eigen::VectorXd FromProto(const VectorMessage& message) {
  return Eigen::Map<const Eigen::VectorXd>(message.data(), message.size());
}

void ToProto(const std::vector<UnobservedDirection>& directions,
             DirectionMessages* messages) {
  for (const UnobservedDirection& direction : directions) {
    v1::UnobservedDirection* message = messages->Add();
    message->set_information_ratio(direction.information_ratio);
    for (const UnobservedDirection::Part& part : direction.parts) {
      v1::UnobservedDirection::Part* added = message->add_parts();
      added->set_component(part.component);
      added->set_weight(part.weight);
    }
  }
}

std::vector<UnobservedDirection> FromProto(const DirectionMessages& messages) {
  std::vector<UnobservedDirection> directions;
  directions.reserve(messages.size());
  for (const v1::UnobservedDirection& message : messages) {
    UnobservedDirection direction;
    direction.information_ratio = message.information_ratio();
    for (const auto& part : message.parts()) {
      direction.parts.push_back({part.component(), part.weight()});
    }
    directions.push_back(std::move(direction));
  }
  return directions;
}

v1::GroupScore ToProto(const GroupScore& score) {
  v1::GroupScore message;
  message.set_group(score.group);
  message.set_size(score.size);
  message.set_entropy_nats(score.entropy);
  message.set_gain_nats(score.gain);
  message.set_rank(score.rank);
  ToProto(score.unobserved, message.mutable_unobserved());
  return message;
}

GroupScore FromProto(const v1::GroupScore& message) {
  GroupScore score;
  score.group = message.group();
  score.size = message.size();
  score.entropy = message.entropy_nats();
  score.gain = message.gain_nats();
  score.rank = message.rank();
  score.unobserved = FromProto(message.unobserved());
  return score;
}

v1::ResidualStatistics ToProto(const ResidualStatistics& residuals) {
  v1::ResidualStatistics message;
  message.set_observations(residuals.observations);
  message.set_inliers(residuals.inliers);
  message.set_not_projectable(residuals.not_projectable);
  message.set_outliers(residuals.outliers);
  message.set_landmarks(residuals.landmarks);
  message.set_landmarks_used(residuals.landmarks_used);
  message.set_reprojection_rms_px(residuals.reprojection_rms_px);
  message.set_reprojection_median_px(residuals.reprojection_median_px);
  message.mutable_inertial_rms()->Assign(residuals.inertial_rms.begin(),
                                         residuals.inertial_rms.end());
  message.mutable_imu1_inertial_rms()->Assign(
      residuals.second_inertial_rms.begin(),
      residuals.second_inertial_rms.end());
  message.set_many_outliers(residuals.many_outliers);
  message.set_fit(residuals.fit);
  message.set_imu_gaps(residuals.imu_gaps);
  message.set_longest_imu_gap_s(residuals.longest_imu_gap_s);
  return message;
}

ResidualStatistics FromProto(const v1::ResidualStatistics& message) {
  ResidualStatistics residuals;
  residuals.observations = message.observations();
  residuals.inliers = message.inliers();
  residuals.not_projectable = message.not_projectable();
  residuals.outliers = message.outliers();
  residuals.landmarks = message.landmarks();
  residuals.landmarks_used = message.landmarks_used();
  residuals.reprojection_rms_px = message.reprojection_rms_px();
  residuals.reprojection_median_px = message.reprojection_median_px();
  residuals.inertial_rms.assign(message.inertial_rms().begin(),
                                message.inertial_rms().end());
  residuals.second_inertial_rms.assign(message.imu1_inertial_rms().begin(),
                                       message.imu1_inertial_rms().end());
  residuals.many_outliers = message.many_outliers();
  residuals.fit = message.fit();
  residuals.imu_gaps = message.imu_gaps();
  residuals.longest_imu_gap_s = message.longest_imu_gap_s();
  return residuals;
}

}  // namespace selfcal::server
