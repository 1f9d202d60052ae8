#include "core/factor/ceres_factors.h"
#include "core/factor/quaternion_block.h"
#include "core/factor/theta_block.h"

namespace selfcal {
namespace {

using Eigen::Map;
using Eigen::Vector3d;
template <int cols>
using RowMajor15 = Eigen::Matrix<double, 15, cols, Eigen::RowMajor>;

// The blocks of a state are consecutive: q, p, vb.
enum Block { kTheta, kState0, kState1 = kState0 + 3 };

KeyframeState ReadState(std::int64_t t_ns, double const* const* blocks) {
  const double* vb = blocks[2];
  return {.t_ns = t_ns,
          .q_GI = ReadQuaternion(blocks[0]),
          .p_GI = Map<const Vector3d>(blocks[1]),
          .v_GI = Map<const Vector3d>(vb),
          .b_a = Map<const Vector3d>(vb + 3),
          .b_g = Map<const Vector3d>(vb + 6)};
}

// `J` is whitened, with respect to a state.
void WriteStateJacobians(const InertialMatrix& J,
                         const Eigen::Quaterniond& q_GI,
                         double** blocks) {
  if (blocks[0] != nullptr) {
    Map<RowMajor15<4>> by_q(blocks[0]);
    by_q = J.middleCols<3>(kStateRotation) * QuaternionMinusJacobian(q_GI);
  }
  if (blocks[1] != nullptr) {
    Map<RowMajor15<3>> by_p(blocks[1]);
    by_p = J.middleCols<3>(kStatePosition);
  }
  if (blocks[2] != nullptr) {
    Map<RowMajor15<9>> by_vb(blocks[2]);
    by_vb = J.rightCols<9>();
  }
}

class InertialCost final : public ceres::CostFunction {
 public:
  InertialCost(const Calibration& theta_reference,
               std::span<const ImuSample> samples,
               std::int64_t t0_ns,
               std::int64_t t1_ns,
               const ImuNoise& noise,
               double gravity_mps2,
               const InertialMatrix& square_root_information)
      : imu_reference_(theta_reference.imu),
        theta_size_(TangentSize(theta_reference)),
        samples_(samples),
        t0_ns_(t0_ns),
        t1_ns_(t1_ns),
        noise_(noise),
        gravity_mps2_(gravity_mps2),
        W_(square_root_information) {
    set_num_residuals(15);
    *mutable_parameter_block_sizes() = {theta_size_, 4, 3, 9, 4, 3, 9};
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const KeyframeState x0 = ReadState(t0_ns_, parameters + kState0);
    const KeyframeState x1 = ReadState(t1_ns_, parameters + kState1);
    InertialJacobians J;
    Map<InertialResidual> r(residuals);
    r = W_ * EvaluateInertial(samples_,
                              x0,
                              x1,
                              OffsetImu(imu_reference_, parameters[kTheta]),
                              noise_,
                              gravity_mps2_,
                              jacobians == nullptr ? nullptr : &J,
                              nullptr);
    if (jacobians == nullptr) return true;
    if (double* out = jacobians[kTheta]) {
      ByRotationOffset(parameters[kTheta] + kAccelRotation,
                       J.theta.middleCols<3>(kAccelRotation));
      Map<RowMajor15<Eigen::Dynamic>> by_theta(out, 15, theta_size_);
      by_theta.setZero();
      by_theta.leftCols(J.theta.cols()) = W_ * J.theta;
    }
    WriteStateJacobians(W_ * J.x0, x0.q_GI, jacobians + kState0);
    WriteStateJacobians(W_ * J.x1, x1.q_GI, jacobians + kState1);
    return true;
  }

 private:
  const ImuCalibration imu_reference_;
  const int theta_size_;
  const std::span<const ImuSample> samples_;
  const std::int64_t t0_ns_, t1_ns_;
  const ImuNoise noise_;
  const double gravity_mps2_;
  const InertialMatrix W_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeInertialCost(
    const Calibration& theta_reference,
    std::span<const ImuSample> samples,
    std::int64_t t0_ns,
    std::int64_t t1_ns,
    const ImuNoise& noise,
    double gravity_mps2,
    const InertialMatrix& square_root_information) {
  return std::make_unique<InertialCost>(theta_reference,
                                        samples,
                                        t0_ns,
                                        t1_ns,
                                        noise,
                                        gravity_mps2,
                                        square_root_information);
}

}  // namespace selfcal
