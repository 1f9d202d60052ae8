#include "core/calibration/noise_balance.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"
#include "test/core/calibration/noisy_walk.h"

namespace selfcal {
namespace {

// A round at its minimum.
struct Solved {
  Solved(const Rig& rig, std::vector<MotionSegment> of_walk)
      : rig(rig),
        segments(std::move(of_walk)),
        sorted(SortByKey(segments)),
        problem(FlattenSegments(rig, sorted, PartitionSegments(sorted, 15))),
        basis(TangentBasis(rig, WholeSubspace(rig))),
        estimate{Eigen::VectorXd::Zero(TangentSize(rig.factory)),
                 problem.keyframes} {
    // Twice, since distant observations are accurate only near the minimum.
    for (int i = 0; i < 2; ++i) Solve();
  }

  void Solve() {
    const Calibration theta = BoxPlus(rig.factory, estimate.d);
    MeasureMotions(rig, theta, problem, estimate.keyframes, &motions);
    const Screening screening = ScreenLandmarks(
        rig, theta, problem, estimate.keyframes, motions, {}, nullptr);
    loss = screening.loss;
    landmarks = screening.landmarks;
    // Some have a reduced weight.
    for (std::size_t i = 0; i < landmarks.size(); i += 5) {
      landmarks[i].weight = 0.5;
    }
    whitening = WhitenInertialLinks(rig, theta, problem, estimate.keyframes);
    const auto go_on = [](int, double, const Eigen::VectorXd&) {
      return SolverSignal::kGoOn;
    };
    EXPECT_EQ(
        SolveRound(
            SolverKind::kStructured, Round(), go_on, &estimate, &landmarks)
            .status,
        SolverStatus::kConverged);
  }

  SolverRound Round() const {
    return {.rig = rig,
            .reference = rig.factory,
            .problem = problem,
            .motions = motions,
            .whitening = whitening,
            .basis = basis,
            .loss = loss};
  }

  const Rig rig;
  const std::vector<MotionSegment> segments;
  const std::vector<const MotionSegment*> sorted;
  const CalibrationProblem problem;
  const Eigen::MatrixXd basis;
  KeyframeMotions motions;
  CalibrationEstimate estimate;
  RobustLoss loss;
  std::vector<ScreenedLandmark> landmarks;
  std::vector<InertialMatrix> whitening;
};

// All rows of a round, whitened for given noise scales: an independent
// assembly.
// Columns are keyframes, theta and landmarks.
class DenseRound {
 public:
  DenseRound(const Solved& solved,
             const NoiseVector<kNoiseKinds>& factors,
             double track_noise)
      : solved_(solved),
        rig_(solved.rig),
        theta_(BoxPlus(solved.rig.factory, solved.estimate.d)),
        theta_column_(15 * static_cast<int>(solved.problem.keyframes.size())),
        landmark_column_(theta_column_ + TangentSize(theta_)),
        columns_(landmark_column_ +
                 3 * static_cast<int>(solved.landmarks.size())),
        excess_(
            std::max(1.0, track_noise / factors[IndexOf(NoiseKind::kPixel)])) {
    for (int i = 0; i < kNoiseKinds; ++i) {
      ScaleNoise(static_cast<NoiseKind>(i), factors[i], &rig_);
    }
    for (const InertialLink& link : solved.problem.inertial_links) {
      AddInertial(link);
    }
    for (const BiasLink& link : solved.problem.bias_links) AddWalk(link);
    for (const int k : solved.problem.chain_starts) AddWeakPrior(k);
    for (const int k : solved.problem.gauge_keyframes) AddGauge(k);
    first_pixel_row_ = Rows();
    for (std::size_t m = 0; m < solved.landmarks.size(); ++m) AddLandmark(m);
  }

  // The squares of pixels are weighted.
  NoiseBalance<kNoiseKinds> Count() const {
    Eigen::MatrixXd J(Rows(), columns_);
    Eigen::VectorXd r(Rows());
    for (int i = 0; i < Rows(); ++i) {
      J.row(i) = rows_[i].J;
      r(i) = rows_[i].r;
    }
    // Fixed components have no column, and columns are in very different units.
    J = J(Eigen::all, FreeColumns()).eval();
    const Eigen::RowVectorXd scale = J.colwise().norm().cwiseInverse();
    J.array().rowwise() *= scale.array();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J);
    const Eigen::MatrixXd Q =
        qr.householderQ() * Eigen::MatrixXd::Identity(Rows(), J.cols());
    const Eigen::VectorXd left = r - Q * (Q.transpose() * r);

    NoiseBalance<kNoiseKinds> balance;
    const auto add = [&](NoiseKind kind, double squares, double redundancy) {
      balance.squares[IndexOf(kind)] += squares;
      balance.redundancy[IndexOf(kind)] += redundancy;
    };
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const int row = 15 * static_cast<int>(i);
      const auto e = left.segment<15>(row);
      const InertialMatrix unabsorbed =
          InertialMatrix::Identity() -
          Q.middleRows<15>(row) * Q.middleRows<15>(row).transpose();
      for (const auto& [kind, part] : links_[i]) {
        add(kind, e.dot(part * e), (part * unabsorbed).trace());
      }
    }
    for (int i = 0; i < Rows(); ++i) {
      if (rows_[i].kind) {
        add(*rows_[i].kind, left(i) * left(i), 1 - Q.row(i).squaredNorm());
      }
    }
    double absorbed = Q.bottomRows(Rows() - first_pixel_row_).squaredNorm();
    // With the weight w of screening: sums of w and of w^2, and of the means of
    // w over landmarks.
    double shares = 0, squared = 0, landmarks = 0;
    for (const std::vector<double>& of_landmark : shares_) {
      double of_shares = 0, of_squared = 0;
      for (const double share : of_landmark) {
        of_shares += share;
        of_squared += share * share;
      }
      shares += of_shares;
      squared += of_squared;
      landmarks += of_squared / of_shares;
    }
    const double own = 3 * static_cast<double>(solved_.landmarks.size());
    absorbed = squared / shares * (absorbed - own) + 3 * landmarks;
    balance.squares[IndexOf(NoiseKind::kPixel)] =
        left.tail(Rows() - first_pixel_row_).squaredNorm();
    balance.redundancy[IndexOf(NoiseKind::kPixel)] = 2 * shares - absorbed;
    return balance;
  }

 private:
  struct Row {
    Eigen::RowVectorXd J;
    double r = 0;
    // Kind of the row, unless it has several.
    std::optional<NoiseKind> kind;
  };

  std::vector<int> FreeColumns() const {
    std::vector<int> columns;
    for (int i = 0; i < theta_column_; ++i) columns.push_back(i);
    for (const int i : FreeComponents(rig_)) {
      columns.push_back(theta_column_ + i);
    }
    for (int i = landmark_column_; i < columns_; ++i) columns.push_back(i);
    return columns;
  }
  double Weight(const ScreenedLandmark& landmark) const {
    return landmark.weight / (excess_ * excess_);
  }
  int Rows() const { return static_cast<int>(rows_.size()); }
  Row& AddRow(double r) {
    rows_.push_back({Eigen::RowVectorXd::Zero(columns_), r, {}});
    return rows_.back();
  }
  static NoiseKind WalkKind(int component) {
    return component < 3 ? NoiseKind::kAccelBiasWalk : NoiseKind::kGyroBiasWalk;
  }

  void AddInertial(const InertialLink& link) {
    const auto evaluate = [&](const ImuNoise& noise,
                              InertialJacobians* J,
                              InertialMatrix* covariance) {
      return EvaluateInertial(link.samples,
                              solved_.estimate.keyframes[link.before],
                              solved_.estimate.keyframes[link.after],
                              theta_.imu,
                              noise,
                              rig_.gravity_mps2,
                              J,
                              covariance);
    };
    InertialJacobians J;
    InertialMatrix covariance;
    const InertialResidual r = evaluate(rig_.imu_noise, &J, &covariance);
    const InertialMatrix W = SquareRootInformation(covariance);
    std::map<NoiseKind, InertialMatrix>& parts = links_.emplace_back();
    InertialMatrix gaps;
    evaluate({0, 0, 0, 0}, nullptr, &gaps);
    const auto add_part = [&](NoiseKind kind, double ImuNoise::*density) {
      ImuNoise alone = {0, 0, 0, 0};
      alone.*density = rig_.imu_noise.*density;
      evaluate(alone, nullptr, &covariance);
      parts[kind] = W * (covariance - gaps) * W.transpose();
    };
    add_part(NoiseKind::kGyro, &ImuNoise::gyro_noise_density);
    add_part(NoiseKind::kAccel, &ImuNoise::accel_noise_density);
    add_part(NoiseKind::kGyroBiasWalk, &ImuNoise::gyro_bias_random_walk);
    add_part(NoiseKind::kAccelBiasWalk, &ImuNoise::accel_bias_random_walk);
    const InertialResidual white = W * r;
    const InertialMatrix x0 = W * J.x0, x1 = W * J.x1, by_theta = W * J.theta;
    for (int i = 0; i < 15; ++i) {
      Row& row = AddRow(white(i));
      row.J.segment<15>(15 * link.before) = x0.row(i);
      row.J.segment<15>(15 * link.after) = x1.row(i);
      row.J.segment<15>(theta_column_) = by_theta.row(i);
    }
  }

  void AddWalk(const BiasLink& link) {
    const KeyframeState& a = solved_.estimate.keyframes[link.before];
    const KeyframeState& b = solved_.estimate.keyframes[link.after];
    const double dt_s = static_cast<double>(b.t_ns - a.t_ns) * 1e-9;
    const Eigen::Matrix<double, 6, 1> sigmas =
        BiasWalkSigmas(rig_.imu_noise, dt_s);
    Eigen::Matrix<double, 6, 1> walk;
    walk << b.b_a - a.b_a, b.b_g - a.b_g;
    for (int i = 0; i < 6; ++i) {
      Row& row = AddRow(walk(i) / sigmas(i));
      row.J(15 * link.before + kStateAccelBias + i) = -1 / sigmas(i);
      row.J(15 * link.after + kStateAccelBias + i) = 1 / sigmas(i);
      row.kind = WalkKind(i);
    }
  }

  void AddWeakPrior(int k) {
    const auto add = [&](int component, double sigma) {
      for (int i = 0; i < 3; ++i) {
        AddRow(0).J(15 * k + component + i) = 1 / sigma;
      }
    };
    add(kStateRotation, kTiltPriorSigma_rad);
    add(kStateVelocity, kVelocityPriorSigma_mps);
    add(kStateAccelBias, kAccelBiasPriorSigma_mps2);
    add(kStateGyroBias, kGyroBiasPriorSigma_radps);
  }

  // A gauge of any strength beyond that of the data.
  void AddGauge(int k) {
    constexpr double kStrength = 1e5;
    for (int i = 0; i < 3; ++i) {
      AddRow(0).J(15 * k + kStatePosition + i) = kStrength;
    }
    AddRow(0).J.segment<3>(15 * k + kStateRotation) =
        kStrength * (solved_.estimate.keyframes[k].q_GI.conjugate() *
                     Eigen::Vector3d::UnitZ())
                        .transpose();
  }

  void AddLandmark(std::size_t m) {
    const ScreenedLandmark& landmark = solved_.landmarks[m];
    const Track& track = solved_.problem.tracks[landmark.track];
    const Eigen::Vector4d point = landmark.position.Homogeneous();
    const int column = landmark_column_ + 3 * static_cast<int>(m);
    shares_.emplace_back();
    for (const UsedObservation& used : landmark.used) {
      const TrackObservation& seen = track.observations[used.index];
      const KeyframeState& x = solved_.estimate.keyframes[seen.keyframe];
      Eigen::Vector2d r;
      ReprojectionJacobians J;
      ASSERT_TRUE(Reproject(x.q_GI,
                            x.p_GI,
                            theta_.cameras[seen.camera],
                            point,
                            seen.z_px,
                            &r,
                            &J));
      r /= rig_.pixel_sigma_px;
      RobustLoss loss = solved_.loss;
      loss.gate = 5;
      const double share = Weight(landmark) * used.weight;
      const double of_loss = loss.Weight(r.squaredNorm());
      if (of_loss == 0) continue;  // beyond the gate
      shares_.back().push_back(share);
      const double w = std::sqrt(share * of_loss);
      const double scale = w / rig_.pixel_sigma_px;
      for (int i = 0; i < 2; ++i) {
        Row& row = AddRow(w * r(i));
        row.J.segment<6>(15 * seen.keyframe) = scale * J.pose.row(i);
        row.J.segment(theta_column_ + CameraTangentOffset(theta_, seen.camera),
                      J.camera.cols()) = scale * J.camera.row(i);
        row.J.segment<3>(column) =
            scale * point.w() * J.landmark.row(i).head<3>();
      }
    }
    const double rho = landmark.position.inverse_depth.z();
    const double scale = std::sqrt(Weight(landmark)) / kInverseDepthSigma;
    AddRow(scale * rho).J.segment<3>(column) =
        -scale * rho * rho * landmark.position.anchor.R_GA.col(2).transpose();
  }

  const Solved& solved_;
  Rig rig_;
  const Calibration theta_;
  const int theta_column_, landmark_column_, columns_;
  const double excess_;  // of the track noise over that of the pixels
  int first_pixel_row_ = 0;
  std::vector<Row> rows_;                    // inertial links first
  std::vector<std::vector<double>> shares_;  // of the landmarks
  // Parts of the whitened covariance of each link by kind.
  std::vector<std::map<NoiseKind, InertialMatrix>> links_;
};

void ExpectEqualsDense(const Solved& solved, double track_noise) {
  const SolverRound round = solved.Round();
  NoiseProblem<kNoiseKinds> problem(
      round, solved.estimate, solved.landmarks, track_noise);
  // Earlier evaluations make no difference.
  for (const double pixel : {0.8, 1.7, 1.0}) {
    NoiseVector<kNoiseKinds> factors(pixel, 1.4, 0.7, 0.6, 2.0);
    const std::optional<NoiseBalance<kNoiseKinds>> balance =
        problem.Evaluate(factors.array().log());
    ASSERT_TRUE(balance.has_value());
    const NoiseBalance<kNoiseKinds> dense =
        DenseRound(solved, factors, track_noise).Count();
    for (int i = 0; i < kNoiseKinds; ++i) {
      SCOPED_TRACE(NoiseKindName(static_cast<NoiseKind>(i)));
      EXPECT_NEAR(balance->redundancy[i],
                  dense.redundancy[i],
                  1e-6 * (1 + dense.redundancy[i]));
      if (i == IndexOf(NoiseKind::kPixel)) {
        // Normalised to the squares of normal residuals without a loss.
        EXPECT_GT(balance->squares[i], dense.squares[i]);
        EXPECT_LT(balance->squares[i], 1.3 * dense.squares[i]);
      } else {
        EXPECT_NEAR(balance->squares[i],
                    dense.squares[i],
                    1e-6 * (1 + dense.squares[i]));
      }
    }
  }
}

TEST(NoiseBalance, EqualsTheDenseOne) {
  ExpectEqualsDense({NoisyRig(), Walk(NoisyRig(), 2, 12, 50, 1)}, 0);
}

TEST(NoiseBalance, WithTrackNoiseEqualsTheDenseOne) {
  ExpectEqualsDense({NoisyRig(), Walk(NoisyRig(), 2, 12, 50, 1)}, 1.5);
}

// Biases that walk as far as the noise, so that they affect the motion as well.
TEST(NoiseBalance, WithStrongWalksAndLostSamplesEqualsTheDenseOne) {
  Rig rig = NoisyRig();
  rig.imu_noise.gyro_bias_random_walk = 5e-2;
  rig.imu_noise.accel_bias_random_walk = 5e-1;
  std::vector<MotionSegment> segments = Walk(rig, 2, 12, 50, 3);
  std::vector<ImuSample>& imu = segments[1].imu;
  imu.erase(imu.begin() + 90, imu.begin() + 105);
  ExpectEqualsDense({rig, std::move(segments)}, 0);
}

TEST(NoiseBalance, OverAGapEqualsTheDenseOne) {
  Rig rig = NoisyRig();
  rig.imu_noise.gyro_bias_random_walk = 1e-2;
  rig.imu_noise.accel_bias_random_walk = 1;
  std::vector<MotionSegment> segments = Walk(rig, 3, 12, 50, 2);
  segments.erase(segments.begin() + 1);
  const Solved solved(rig, std::move(segments));
  EXPECT_EQ(solved.problem.bias_links.size(), 1u);
  ExpectEqualsDense(solved, 0);
}

}  // namespace
}  // namespace selfcal
