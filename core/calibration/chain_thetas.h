// theta_s of the chains of a problem: theta at the temperature of each
// (core/model/temperature.h). Without slopes, all chains have theta itself.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/problem.h"
#include "core/model/calibration.h"

namespace selfcal {

class ChainThetas {
 public:
  // One for all keyframes: `theta`, which has no slopes.
  ChainThetas(Calibration theta);  // NOLINT(google-explicit-constructor)
  ChainThetas(const Calibration& theta, const CalibrationProblem& problem);

  const Calibration& OfKeyframe(int keyframe) const {
    return all_[IndexOf(keyframe)];
  }

  // The distinct ones.
  int size() const { return static_cast<int>(all_.size()); }
  const Calibration& operator[](int index) const { return all_[index]; }
  int IndexOf(int keyframe) const {
    return index_.empty() ? 0 : index_[keyframe];
  }
  // D0 x D: TemperatureDerivative of one of them; null without slopes, where it
  // is the identity.
  const Eigen::MatrixXd* Derivative(int index) const {
    return derivatives_.empty() ? nullptr : &derivatives_[index];
  }

 private:
  std::vector<Calibration> all_;
  std::vector<int> index_;  // of each keyframe; empty: all have the first
  std::vector<Eigen::MatrixXd> derivatives_;
};

}  // namespace selfcal
