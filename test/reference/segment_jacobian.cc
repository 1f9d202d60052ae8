#include "test/reference/segment_jacobian.h"

#include <map>
#include <vector>

#include "core/factor/imu_delay.h"
#include "core/factor/inertial.h"
#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

class Assembly {
 public:
  Assembly(const Rig& rig,
           const Calibration& theta0,
           const MotionSegment& segment,
           const InlierSelection& selection,
           const Eigen::VectorXd& theta_scale,
           int gauge)
      : rig_(rig),
        theta0_(theta0),
        segment_(segment),
        selection_(selection),
        scale_(theta_scale),
        gauge_(gauge),
        motions_(SegmentMotions(rig, theta0, segment)) {
    for (const int index : selection.inliers) {
      landmark_columns_.try_emplace(
          segment.observations[index].landmark,
          3 * static_cast<int>(landmark_columns_.size()));
    }
    int column = 3 * static_cast<int>(landmark_columns_.size());
    for (int k = 0; k < static_cast<int>(segment.keyframes.size()); ++k) {
      state_columns_.push_back(column);
      column += StateTangentSize(theta0) - (k == gauge ? 4 : 0);
    }
    for (int i = 0; i < theta_scale.size(); ++i) {
      theta_columns_.push_back(theta_scale(i) != 0 ? column++ : -1);
    }
    columns_ = column;
  }

  SegmentJacobian Run() {
    AddPriors();
    for (const int index : selection_.inliers) {
      AddObservation(segment_.observations[index]);
    }
    for (std::size_t k = 0; k + 1 < segment_.keyframes.size(); ++k) {
      for (int imu = 0; imu < ImuCount(theta0_); ++imu) {
        AddInertial(static_cast<int>(k), imu);
      }
    }
    SegmentJacobian result;
    result.J.resize(static_cast<int>(r_.size()), columns_);
    result.J.setFromTriplets(entries_.begin(), entries_.end());
    result.r = Eigen::Map<Eigen::VectorXd>(
        r_.data(), static_cast<Eigen::Index>(r_.size()));
    result.theta_size = static_cast<int>((scale_.array() != 0).count());
    return result;
  }

 private:
  void AddBlock(int row, int column, const Eigen::MatrixXd& block) {
    for (int j = 0; j < block.cols(); ++j) {
      for (int i = 0; i < block.rows(); ++i) {
        if (block(i, j) != 0) {
          entries_.emplace_back(row + i, column + j, block(i, j));
        }
      }
    }
  }

  // J by the full dimensions of the tangent of keyframe k.
  void AddState(int row, int k, const Eigen::MatrixXd& J) {
    if (k != gauge_) {
      AddBlock(row, state_columns_[k], J);
      return;
    }
    const Eigen::Matrix3d R_IG =
        segment_.keyframes[k].q_GI.toRotationMatrix().transpose();
    AddBlock(row, state_columns_[k], J.leftCols(3) * R_IG.leftCols(2));
    AddBlock(row, state_columns_[k] + 2, J.rightCols(J.cols() - 6));
  }

  void AddTheta(int row, int offset, const Eigen::MatrixXd& J) {
    for (int j = 0; j < J.cols(); ++j) {
      const int column = theta_columns_[offset + j];
      if (column >= 0) AddBlock(row, column, J.col(j) * scale_(offset + j));
    }
  }

  int AddResidual(const Eigen::VectorXd& r) {
    const int row = static_cast<int>(r_.size());
    r_.insert(r_.end(), r.data(), r.data() + r.size());
    return row;
  }

  void AddPriorOn(int column, int size, double sigma) {
    const int row = AddResidual(Eigen::VectorXd::Zero(size));
    AddBlock(row, column, Eigen::MatrixXd::Identity(size, size) / sigma);
  }

  void AddPriors() {
    for (const auto& [landmark, column] : landmark_columns_) {
      AddPriorOn(column, 3, kLandmarkPriorSigma_m);
    }
    AddPriorOn(state_columns_[gauge_], 2, kTiltPriorSigma_rad);
    for (int imu = 0; imu < ImuCount(theta0_); ++imu) {
      const int motion =
          state_columns_[0] + (gauge_ == 0 ? 2 : 6) + imu * kMotionTangentSize;
      AddPriorOn(motion, 3, kVelocityPriorSigma_mps);
      AddPriorOn(motion + 3, 3, kAccelBiasPriorSigma_mps2);
      AddPriorOn(motion + 6, 3, kGyroBiasPriorSigma_radps);
    }
  }

  void AddObservation(const Observation& observation) {
    const KeyframeState& x = segment_.keyframes[observation.keyframe];
    const Eigen::Vector3d& p_G = selection_.landmarks[observation.landmark];
    Eigen::Vector2d r;
    ReprojectionJacobians J;
    if (!Reproject(x.q_GI,
                   x.p_GI,
                   theta0_.cameras[observation.camera],
                   p_G.homogeneous(),
                   observation.z_px,
                   &r,
                   &J,
                   motions_.At(observation.keyframe, observation.camera))) {
      return;
    }
    const double w = 1 / rig_.pixel_sigma_px;
    const int row = AddResidual(w * r);
    Eigen::MatrixXd state = Eigen::MatrixXd::Zero(2, StateTangentSize(theta0_));
    state.leftCols(6) = w * J.pose;
    AddState(row, observation.keyframe, state);
    AddBlock(row,
             landmark_columns_.at(observation.landmark),
             w * J.landmark.leftCols(3));
    AddTheta(
        row, CameraTangentOffset(theta0_, observation.camera), w * J.camera);
  }

  void AddInertial(int k, int imu) {
    const KeyframeState& x0 = segment_.keyframes[k];
    const KeyframeState& x1 = segment_.keyframes[k + 1];
    InertialJacobians J;
    InertialMatrix covariance;
    const InertialResidual r =
        EvaluateInertial(imu == 0 ? SamplesFromFirstKeyframe(segment_)
                                  : SecondSamplesFromFirstKeyframe(segment_),
                         StateOfImu(theta0_, imu, x0),
                         StateOfImu(theta0_, imu, x1),
                         ImuOf(theta0_, imu),
                         NoiseOfImu(rig_, imu),
                         rig_.gravity_mps2,
                         &J,
                         &covariance);
    const InertialMatrix W = SquareRootInformation(covariance);
    const int row = AddResidual(W * r);
    const int first = imu == 0 ? 0 : ImuTangentSize(theta0_.imu);
    AddTheta(row, first, W * J.theta);
    if (imu == 1) {
      AddTheta(row,
               LinkTangentSize(theta0_) - 1,
               W * ResidualByDelay(SecondSamplesFromFirstKeyframe(segment_),
                                   StateOfImu(theta0_, imu, x0),
                                   StateOfImu(theta0_, imu, x1),
                                   *theta0_.imu1,
                                   r));
    }
    AddImuState(row, k, imu, W * J.x0);
    AddImuState(row, k + 1, imu, W * J.x1);
  }

  // J by the state of an IMU at keyframe k.
  void AddImuState(int row, int k, int imu, const Eigen::MatrixXd& J) {
    Eigen::MatrixXd by_state =
        Eigen::MatrixXd::Zero(J.rows(), StateTangentSize(theta0_));
    by_state.middleCols(6 + imu * kMotionTangentSize, kMotionTangentSize) =
        J.rightCols(kMotionTangentSize);
    by_state.leftCols(6) = J.leftCols(6);
    if (imu == 1) {
      const MountDerivatives at =
          DerivativesOfMount(*theta0_.imu1, segment_.keyframes[k]);
      by_state.leftCols(6) = J.leftCols(6) * at.by_pose;
      AddTheta(row,
               LinkTangentSize(theta0_) - kMountTangentSize,
               J.leftCols(6) * at.by_mount);
    }
    AddState(row, k, by_state);
  }

  const Rig& rig_;
  const Calibration& theta0_;
  const MotionSegment& segment_;
  const InlierSelection& selection_;
  const Eigen::VectorXd& scale_;
  const int gauge_;
  const KeyframeMotions motions_;
  std::map<int, int> landmark_columns_;
  std::vector<int> state_columns_;
  std::vector<int> theta_columns_;
  int columns_ = 0;
  std::vector<Eigen::Triplet<double>> entries_;
  std::vector<double> r_;
};

}  // namespace

SegmentJacobian BuildSegmentJacobian(const Rig& rig,
                                     const Calibration& theta0,
                                     const MotionSegment& segment,
                                     const InlierSelection& selection,
                                     const Eigen::VectorXd& theta_scale,
                                     int gauge_keyframe) {
  return Assembly(rig, theta0, segment, selection, theta_scale, gauge_keyframe)
      .Run();
}

}  // namespace selfcal
