// A rig with a factory's version, one that was calibrated, and its segments.
#pragma once

#include <string>

#include "client/report/report.h"

namespace selfcal::client {

inline v1::Calibration AVersion(int version, double sigma) {
  v1::Calibration calibration;
  calibration.set_name("rigs/device/calibrations/" + std::to_string(version));
  calibration.set_version(version);
  calibration.set_state(version == 1 ? v1::Calibration::SUPERSEDED
                                     : v1::Calibration::ACTIVE);
  calibration.mutable_create_time()->set_seconds(1'795'234'203);
  for (const char* const component : {"cam0.focal.x", "imu.gyro.scale.x"}) {
    auto* estimate = calibration.add_estimates();
    estimate->set_component(component);
    estimate->set_value(0.123456 * version);
    estimate->set_sigma(sigma);
    estimate->set_unit("px");
  }
  if (version == 1) {
    calibration.mutable_verdict()->set_kind(v1::Verdict::FACTORY);
    calibration.mutable_verdict()->set_text("factory");
    return calibration;
  }
  calibration.mutable_verdict()->set_kind(v1::Verdict::GOOD);
  calibration.mutable_verdict()->set_text("good");
  calibration.mutable_provenance()->set_recalibration(
      "rigs/device/recalibrations/1");
  calibration.mutable_provenance()->add_segments("rigs/device/segments/walk~0");
  auto* held_out = calibration.mutable_validation()->mutable_held_out();
  held_out->set_segments(3);
  held_out->set_degrees(60);
  held_out->set_chi_square(58);
  held_out->set_probability(0.55);
  return calibration;
}

inline ReportData ADevice() {
  ReportData data;
  data.rig.set_name("rigs/device");
  data.calibration = AVersion(2, 0.01);
  data.versions = {data.calibration, AVersion(1, 1.0)};
  v1::Table table;
  table.set_name("rigs/device/tables/camera");
  data.tables.push_back(table);
  for (int k = 2; k >= 0; --k) {
    v1::Segment segment;
    segment.set_name("rigs/device/segments/walk~" + std::to_string(k));
    segment.set_sequence(k + 1);
    auto* score = segment.add_scores();
    score->set_group("camera");
    score->set_entropy_nats(-10 - k);
    score->set_in_table(k == 0);
    segment.mutable_residuals()->set_reprojection_rms_px(0.5 + k);
    segment.mutable_residuals()->add_inertial_rms(1.0);
    data.segments.push_back(segment);
  }
  return data;
}

}  // namespace selfcal::client
