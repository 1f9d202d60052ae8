// The statistics of a cohort: devices of one model, whose theta are draws from
// a normal distribution N(mu, S) about a common reference. The calibration of
// each device is a measurement of its theta with known information; directions
// that it does not observe count for nothing.
//
// Pure functions, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "core/information/fusion.h"
#include "core/model/calibration.h"

namespace selfcal {

// Fewest devices from which a cohort is estimated.
inline constexpr int kLeastCohort = 5;

struct CohortOptions {
  // A device is left out if the chance that one of a cohort of this size is as
  // far from the others is smaller.
  double false_alarm = 0.01;
  // Asked between steps, if there is one: true ends the estimate early, whose
  // result is then of no use. The less devices differ, the more steps it takes.
  std::function<bool()> cancelled = {};
};

struct Cohort {
  Calibration reference;
  // Units in which the statistics start from nothing: what is known of a
  // device without any data, e.g. the factory's tolerances.
  Eigen::VectorXd scale;
  // Mean offset of the devices from the reference, D.
  Eigen::VectorXd mu;
  Eigen::MatrixXd mu_covariance;  // D x D
  // Spread of the devices about the mean, D x D, positive definite. A component
  // without data has that of the scale.
  Eigen::MatrixXd S;
  // Degrees of freedom of the estimate of each component of S, about the
  // number of devices that determine it, less one. 0: not determined.
  Eigen::VectorXd degrees;
  // Share of the correlations of the devices that predicts devices best.
  double correlation = 0;
  // Devices that the estimate is of, and those that contradict it; ascending.
  std::vector<int> devices;
  std::vector<int> outliers;
};

// `devices` are the information of each about the offset from `reference`
// (device.h), D components each. The first estimate is by medians, so that
// broken devices do not hide themselves; those that are inconsistent with the
// others are then left out. The share of the correlations is chosen by
// cross-validation. Of fewer than kLeastCohort devices nothing but the scale is
// known.
Cohort EstimateCohort(const Calibration& reference,
                      const Eigen::VectorXd& scale,
                      std::span<const ThetaInformation> devices,
                      const CohortOptions& options = {});

// A normal distribution for the offset of a new device from the reference.
struct DevicePrediction {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  // of the device, mu and S being uncertain
};
DevicePrediction PredictDevice(const Cohort& cohort);

}  // namespace selfcal
