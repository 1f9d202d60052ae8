// What a score and a recalibration leave in the store, made up: values that are
// valid for the rig, for tests that do not compute any.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// Every component observed, with this gain [nat] in every group.
inline SegmentInformation TestInformation(const Rig& rig, double gain) {
  const auto size = TangentSize(rig.factory);
  SegmentInformation information;
  information.theta0 = rig.factory;
  information.Lambda = Eigen::MatrixXd::Identity(size, size);
  information.eta = Eigen::VectorXd::Zero(size);
  information.rank = static_cast<int>(FreeComponents(rig).size());
  for (const ParameterGroup& group : rig.groups) {
    const int k = static_cast<int>(GroupComponents(rig, group).size());
    information.groups.push_back({group.name, k, -gain, gain, k, {}});
  }
  return information;
}

// What this run made of version 1: the factory's values, active.
inline StoredCalibration TestCalibration(const Rig& rig, const StoredRun& run) {
  const auto size = TangentSize(rig.factory);
  StoredCalibration calibration;
  calibration.rig = rig.id;
  calibration.state = CalibrationState::kActive;
  calibration.theta = rig.factory;
  calibration.covariance = 4 * Eigen::MatrixXd::Identity(size, size);
  calibration.run = run.run;
  calibration.base_version = 1;
  calibration.segments = run.segments;
  calibration.program_version = "test";
  return calibration;
}

}  // namespace selfcal::server
