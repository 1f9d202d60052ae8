#include "core/factor/preintegration.h"

#include <optional>

#include "core/factor/preintegration_integrator.h"
#include "core/factor/preintegration_readings.h"
#include "core/factor/sampling.h"

namespace selfcal {
namespace preintegration {
namespace {

// Converts to rotations perturbed on the right, as in Preintegration.
template <class Imu>
Preintegration Result(const Integrator<double, Imu>& integrator,
                      const PreintegrationParts& parts,
                      double dt_s) {
  Preintegration result;
  result.dt_s = dt_s;
  result.Delta_R = integrator.motion().Delta_R;
  result.Delta_v = integrator.motion().Delta_v;
  result.Delta_p = integrator.motion().Delta_p;
  const Eigen::Matrix3d& R = integrator.Delta_R();
  if (parts.jacobians) {
    const auto by = integrator.Derivatives();
    result.J_bias = by.bias;
    result.J_theta = by.theta.leftCols(by.columns);
    result.J_bias.template topRows<3>().applyOnTheLeft(R.transpose());
    result.J_theta.template topRows<3>().applyOnTheLeft(R.transpose());
  }
  if (parts.covariance) {
    const MotionCovariance<double>& c = integrator.covariance();
    const Eigen::Matrix3d v_r = c.vr() * R;
    const Eigen::Matrix3d p_r = c.pr() * R;
    result.covariance << R.transpose() * c.rr() * R, v_r.transpose(),
        p_r.transpose(), v_r, c.vv(), c.pv().transpose(), p_r, c.pv(), c.pp();
    const GyroResponse<double>& gyro = integrator.walk().with_gyro();
    const AccelResponse<double>& accel = integrator.walk().with_accel();
    result.covariance_with_walk << Eigen::Matrix3d::Zero(),
        R.transpose() * gyro.r, accel.v, gyro.v, accel.p, gyro.p;
  }
  return result;
}

template <class Imu>
Preintegration Integrate(const Imu& imu,
                         std::span<const ImuSample> samples,
                         std::int64_t t0_ns,
                         std::int64_t t1_ns,
                         const Eigen::Vector3d& b_a,
                         const Eigen::Vector3d& b_g,
                         const ImuNoise& noise,
                         const PreintegrationParts& parts) {
  std::optional<Integrator<double, Imu>> integrator;
  std::optional<Sampling> sampling;
  if (parts.covariance) sampling.emplace(samples, t0_ns, t1_ns, noise);
  const auto visit = [&](const ImuSample& sample, double h, std::size_t next) {
    const Reading<double> reading =
        imu.Correct(sample.gyro, sample.accel, b_g, b_a);
    if (!integrator) {
      integrator.emplace(imu, noise, parts, reading);
      return;
    }
    const StepDensities densities =
        sampling ? sampling->At(next) : StepDensities();
    integrator->Step(reading, h, densities.gyro, densities.accel);
  };
  VisitReadings(samples, t0_ns, t1_ns, visit);
  if (parts.covariance) integrator->Finish();
  return Result(*integrator,
                parts,
                static_cast<double>(t1_ns - t0_ns) * kSecondsPerNanosecond);
}

}  // namespace
}  // namespace preintegration

Preintegration Preintegrate(std::span<const ImuSample> samples,
                            std::int64_t t0_ns,
                            std::int64_t t1_ns,
                            const ImuCalibration& imu,
                            const Eigen::Vector3d& b_a,
                            const Eigen::Vector3d& b_g,
                            const ImuNoise& noise,
                            const PreintegrationParts& parts) {
  const ImuCorrection correction = CorrectionOf(imu);
  const auto integrate = [&](const auto& model) {
    return preintegration::Integrate(
        model, samples, t0_ns, t1_ns, b_a, b_g, noise, parts);
  };
  return IsCoupled(imu) ? integrate(CoupledImuModel<double>(correction))
                        : integrate(ImuModel<double>(correction));
}

}  // namespace selfcal
