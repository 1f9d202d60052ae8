// Predicts the information about theta of one segment of each primitive motion:
// the motion is simulated with the calibration itself, observed by its cameras,
// and scored like a segment of the device. It takes as long as simulating that
// many segments; it does not depend on the present information about theta, so
// that it is done once for a calibration.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/coach/primitives.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/simulation/simulate.h"

namespace selfcal {

struct PredictOptions {
  // Options of the simulated segments; the seed matters, too.
  SimulationOptions simulation;
};

struct MotionPrediction {
  std::string_view motion;       // Primitive::name
  std::string_view instruction;  // Primitive::instruction
  Eigen::MatrixXd Lambda;        // D x D, of one segment, prior not included
};

struct Predictions {
  Calibration theta;                      // calibration at which they hold
  double segment_s = 0;                   // duration of one segment
  std::vector<MotionPrediction> motions;  // in the order of Primitives()
};

// theta must have the shape of rig.factory, and both be valid.
Predictions Predict(const Rig& rig,
                    const Calibration& theta,
                    const PredictOptions& options = {});

// Simulates one segment of a primitive, as handed over by a SLAM system that
// uses theta_slam. Both calibrations must have the shape of rig.factory.
MotionSegment SimulatePrimitive(const Rig& rig,
                                const Calibration& theta_true,
                                const Calibration& theta_slam,
                                const Primitive& primitive,
                                const SimulationOptions& options);

}  // namespace selfcal
