// Calibrations that vary with temperature. A block with a slope k has at the
// temperature T
//   theta(T) = theta [+] k (T - T_ref),
// where T_ref is the reference temperature of theta. Each segment has one
// temperature T_s, and theta_s = theta(T_s), without slopes, is the calibration
// that its samples and pixels depend on. Its information about theta_s is
// information about theta and the slopes through the derivative here; only
// segments of different temperatures determine both.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

bool HasSlopes(const Calibration& theta);

// theta at a temperature [deg C], without slopes; theta itself if it has none.
Calibration AtTemperature(const Calibration& theta, double temperature_c);

// Covariance of AtTemperature(theta), D0 x D0, from that of theta, D x D.
Eigen::MatrixXd CovarianceAtTemperature(const Calibration& theta,
                                        const Eigen::MatrixXd& covariance,
                                        double temperature_c);

// The reason why theta has no value at a temperature: it is not that of a
// device, or the slopes lead to an impossible calibration. Empty if it has one.
std::string TemperatureFault(const Calibration& theta, double temperature_c);

// T_s: the temperature of a segment, or the reference if it states none.
double TemperatureOf(const Calibration& theta, const MotionSegment& segment);

// theta_s of a segment. If theta has no slopes, it is theta itself, not a copy,
// which must outlive this.
class SegmentTheta {
 public:
  SegmentTheta(const Calibration& theta, const MotionSegment& segment);
  SegmentTheta(const Calibration& theta, double temperature_c);

  bool varies() const { return at_.has_value(); }
  const Calibration& operator*() const { return at_ ? *at_ : theta_; }
  const Calibration* operator->() const { return &**this; }

 private:
  const Calibration& theta_;
  std::optional<Calibration> at_;
};

// D0 x D: derivative of the tangent of AtTemperature(theta), D0, by that of
// theta, at theta. The first D0 components of theta are those of
// AtTemperature(theta).
Eigen::MatrixXd TemperatureDerivative(const Calibration& theta,
                                      double temperature_c);

}  // namespace selfcal
