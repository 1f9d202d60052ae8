#include "core/factor/ceres_factors.h"
#include "core/factor/imu_delay.h"
#include "core/factor/quaternion_block.h"
#include "core/factor/theta_block.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

using Eigen::Map;
using Eigen::Vector3d;
template <int cols>
using RowMajor15 = Eigen::Matrix<double, 15, cols, Eigen::RowMajor>;

// The blocks of a state are consecutive: q, p, vb.
enum StateBlock { kMotionTheta, kState0, kState1 = kState0 + 3 };

// A keyframe, with the motion of one IMU.
KeyframeState ReadState(std::int64_t t_ns,
                        int imu,
                        double const* const* blocks) {
  KeyframeState x = {.t_ns = t_ns,
                     .q_GI = ReadQuaternion(blocks[0]),
                     .p_GI = Map<const Vector3d>(blocks[1])};
  const Map<const Eigen::Matrix3d> vb(blocks[2]);
  (imu == 0 ? x.v_GI : x.v_GJ) = vb.col(0);
  (imu == 0 ? x.b_a : x.b_a1) = vb.col(1);
  (imu == 0 ? x.b_g : x.b_g1) = vb.col(2);
  return x;
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
               int imu,
               std::span<const ImuSample> samples,
               std::int64_t t0_ns,
               std::int64_t t1_ns,
               const ImuNoise& noise,
               double gravity_mps2,
               const InertialMatrix& square_root_information)
      : reference_({.imu = theta_reference.imu,
                    .imu1 = theta_reference.imu1,
                    .cameras = {}}),
        imu_(imu),
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
    const KeyframeState x0 = ReadState(t0_ns_, imu_, parameters + kState0);
    const KeyframeState x1 = ReadState(t1_ns_, imu_, parameters + kState1);
    const Calibration theta = OffsetImus(reference_, parameters[kMotionTheta]);
    InertialJacobians J;
    Map<InertialResidual> r(residuals);
    const InertialResidual residual =
        EvaluateInertial(samples_,
                         StateOfImu(theta, imu_, x0),
                         StateOfImu(theta, imu_, x1),
                         ImuOf(theta, imu_),
                         noise_,
                         gravity_mps2_,
                         jacobians == nullptr ? nullptr : &J,
                         nullptr);
    r = W_ * residual;
    if (jacobians == nullptr) return true;
    const double* d = parameters[kMotionTheta];
    Eigen::MatrixXd by_imus =
        Eigen::MatrixXd::Zero(15, LinkTangentSize(reference_));
    const int first = imu_ == 0 ? 0 : ImuTangentSize(reference_.imu);
    by_imus.middleCols(first, J.theta.cols()) = J.theta;
    ByRotationOffset(d + first + kAccelRotation,
                     by_imus.middleCols<3>(first + kAccelRotation));
    if (imu_ == 1) {
      ByKeyframes(*theta.imu1, x0, x1, d, &J, &by_imus);
      by_imus.rightCols<1>() = ResidualByDelay(samples_,
                                               StateOfImu(theta, 1, x0),
                                               StateOfImu(theta, 1, x1),
                                               *theta.imu1,
                                               residual);
    }
    if (double* out = jacobians[kMotionTheta]) {
      Map<RowMajor15<Eigen::Dynamic>> by_theta(out, 15, theta_size_);
      by_theta.setZero();
      by_theta.leftCols(by_imus.cols()) = W_ * by_imus;
    }
    WriteStateJacobians(W_ * J.x0, x0.q_GI, jacobians + kState0);
    WriteStateJacobians(W_ * J.x1, x1.q_GI, jacobians + kState1);
    return true;
  }

 private:
  // Turns derivatives by the states of the second IMU to those by the
  // keyframes, and by the pose of its mount, columns of by_imus before the
  // last.
  static void ByKeyframes(const SecondImuCalibration& imu,
                          const KeyframeState& x0,
                          const KeyframeState& x1,
                          const double* d,
                          InertialJacobians* J,
                          Eigen::MatrixXd* by_imus) {
    const Eigen::Index mount = by_imus->cols() - kMountTangentSize;
    auto by_mount = by_imus->middleCols<kMountPoseSize>(mount);
    const auto carry = [&](const KeyframeState& x, InertialMatrix* by_state) {
      const MountDerivatives at = DerivativesOfMount(imu, x);
      const Eigen::Matrix<double, 15, 6> by_pose = by_state->leftCols<6>();
      by_mount += by_pose * at.by_mount;
      by_state->leftCols<6>() = by_pose * at.by_pose;
    };
    carry(x0, &J->x0);
    carry(x1, &J->x1);
    ByRotationOffset(d + mount, by_mount.leftCols<3>());
  }

  const Calibration reference_;  // without cameras
  const int imu_;
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
    int imu,
    std::span<const ImuSample> samples,
    std::int64_t t0_ns,
    std::int64_t t1_ns,
    const ImuNoise& noise,
    double gravity_mps2,
    const InertialMatrix& square_root_information) {
  return std::make_unique<InertialCost>(theta_reference,
                                        imu,
                                        samples,
                                        t0_ns,
                                        t1_ns,
                                        noise,
                                        gravity_mps2,
                                        square_root_information);
}

}  // namespace selfcal
