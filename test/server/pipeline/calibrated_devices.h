// Rigs whose calibrations are found to be off by what a test says.
#pragma once

#include <atomic>
#include <string>

#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {

class CalibratedDevices : public PipelineTest {
 protected:
  CalibratedDevices() {
    estimators_.calibrate = [this](const Rig& rig,
                                   const Calibration& start,
                                   const SegmentSource&,
                                   const CalibrateOptions&,
                                   const ProgressCallback&,
                                   const auto&) {
      CalibrationResult result = Converged(rig, start);
      result.theta = start;
      result.theta.cameras[0].f.x() += offset_px_;
      result.covariance *= 1e-4;  // known well
      return result;
    };
    StartOne();
  }

  // A rig, whose focal length is found to be off by so much.
  void Calibrate(const std::string& rig, double offset_px) {
    offset_px_ = offset_px;
    CreateRig(rig);
    Submit(0, rig);
    Submit(1, rig);
    ASSERT_TRUE(Eventually([&] {
      const auto active = store_->GetActiveCalibration(rig);
      return active.ok() && active->version == 2;
    }));
  }

  std::atomic<double> offset_px_ = 0;
};

}  // namespace selfcal::server
