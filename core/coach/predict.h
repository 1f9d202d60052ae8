// What one segment of each primitive motion is predicted to say about theta:
// the motion simulated with the calibration itself, seen by its cameras, scored
// like a segment of the device. Takes as long as simulating so many segments;
// what is known of theta does not enter, so that it is done once for a
// calibration.
//
// Pure, deterministic, any thread.
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
  // Of the segments, as the SLAM system sends them; the seed counts, too.
  SimulationOptions simulation;
};

struct MotionPrediction {
  std::string_view motion;       // Primitive::name
  std::string_view instruction;  // Primitive::instruction
  Eigen::MatrixXd Lambda;        // D x D, of one segment, prior not included
};

struct Predictions {
  Calibration theta;                      // about which they hold
  double segment_s = 0;                   // that one segment lasts
  std::vector<MotionPrediction> motions;  // in the order of Primitives()
};

// theta must have the shape of rig.factory, and both be valid.
Predictions Predict(const Rig& rig,
                    const Calibration& theta,
                    const PredictOptions& options = {});

// One segment of a primitive, as a SLAM system that believes theta_slam hands
// it over. Both calibrations must have the shape of rig.factory.
MotionSegment SimulatePrimitive(const Rig& rig,
                                const Calibration& theta_true,
                                const Calibration& theta_slam,
                                const Primitive& primitive,
                                const SimulationOptions& options);

}  // namespace selfcal
