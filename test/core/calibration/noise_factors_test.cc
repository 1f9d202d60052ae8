#include "core/calibration/noise_factors.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/partition.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/factor/reprojection.h"
#include "core/information/weak_priors.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

constexpr int At(NoiseKind kind) { return static_cast<int>(kind); }

// A device whose IMU is so much noisier than that of a phone that a few
// seconds tell its noise.
Rig NoisyRig() {
  Rig rig = HandheldRig("r");
  rig.imu_noise.gyro_noise_density = 5e-3;
  rig.imu_noise.accel_noise_density = 5e-2;
  return rig;
}

std::vector<MotionSegment> Walk(const Rig& rig,
                                int segments,
                                int keyframes,
                                int landmarks,
                                std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = keyframes;
  options.landmarks_in_view = landmarks;
  options.revisit_fraction = 0;
  const double seconds = segments * keyframes / 10.0 + 0.5;
  return Simulate(rig,
                  rig.factory,
                  rig.factory,
                  *MakeHandheld(seconds, 1.0, seed),
                  "session",
                  options)
      .segments;
}

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
    // Twice, as what lies far off is only known near the minimum.
    for (int i = 0; i < 2; ++i) Solve();
  }

  void Solve() {
    const Calibration theta = BoxPlus(rig.factory, estimate.d);
    MeasureMotions(rig, theta, problem, estimate.keyframes, &motions);
    const Screening screening = ScreenLandmarks(
        rig, theta, problem, estimate.keyframes, motions, {}, nullptr);
    loss = screening.loss;
    landmarks = screening.landmarks;
    // Some of less weight.
    for (std::size_t i = 0; i < landmarks.size(); i += 5) {
      landmarks[i].weight = 0.5;
    }
    whitening =
        WhitenInertialLinks(rig, theta.imu, problem, estimate.keyframes);
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

// All rows of a round, whitened for given factors: an assembly of its own.
// Columns are keyframes, theta and landmarks.
class DenseRound {
 public:
  DenseRound(const Solved& solved, const std::vector<NoiseFactor>& factors)
      : solved_(solved),
        rig_(solved.rig),
        theta_(BoxPlus(solved.rig.factory, solved.estimate.d)),
        theta_column_(15 * static_cast<int>(solved.problem.keyframes.size())),
        landmark_column_(theta_column_ + TangentSize(theta_)),
        columns_(landmark_column_ +
                 3 * static_cast<int>(solved.landmarks.size())) {
    for (const NoiseFactor& factor : factors) {
      *NoiseOf(factor.kind, &rig_) *= factor.factor;
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

  // Squares of what no unknown explains, and how many of them are left.
  struct Balance {
    std::array<double, kNoiseKinds> squares = {}, redundancy = {};
  };
  Balance Count() const {
    Eigen::MatrixXd J(Rows(), columns_);
    Eigen::VectorXd r(Rows());
    for (int i = 0; i < Rows(); ++i) {
      J.row(i) = rows_[i].J;
      r(i) = rows_[i].r;
    }
    // Columns are in very different units.
    const Eigen::RowVectorXd scale = J.colwise().norm().cwiseInverse();
    J.array().rowwise() *= scale.array();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J);
    const Eigen::MatrixXd Q =
        qr.householderQ() * Eigen::MatrixXd::Identity(Rows(), columns_);
    const Eigen::VectorXd left = r - Q * (Q.transpose() * r);

    Balance balance;
    const auto add = [&](NoiseKind kind, double squares, double redundancy) {
      balance.squares[At(kind)] += squares;
      balance.redundancy[At(kind)] += redundancy;
    };
    for (std::size_t i = 0; i < by_gyro_.size(); ++i) {
      const int row = 15 * static_cast<int>(i);
      const auto e = left.segment<9>(row);
      const Eigen::Matrix<double, 9, 9> unabsorbed =
          Eigen::Matrix<double, 9, 9>::Identity() -
          Q.middleRows<9>(row) * Q.middleRows<9>(row).transpose();
      add(NoiseKind::kGyro,
          e.dot(by_gyro_[i] * e),
          (by_gyro_[i] * unabsorbed).trace());
      add(NoiseKind::kAccel,
          e.dot(by_accel_[i] * e),
          (by_accel_[i] * unabsorbed).trace());
    }
    for (int i = 0; i < Rows(); ++i) {
      if (rows_[i].kind) {
        add(*rows_[i].kind, left(i) * left(i), 1 - Q.row(i).squaredNorm());
      }
    }
    double absorbed = Q.bottomRows(Rows() - first_pixel_row_).squaredNorm();
    double observations = 0, rows = 0, landmarks = 0;
    for (const ScreenedLandmark& landmark : solved_.landmarks) {
      const auto used = static_cast<double>(landmark.used.size());
      observations += used;
      rows += 2 * landmark.weight * used;
      landmarks += landmark.weight;
    }
    const double own = 3 * static_cast<double>(solved_.landmarks.size());
    absorbed = rows / (2 * observations) * (absorbed - own) + 3 * landmarks;
    balance.redundancy[At(NoiseKind::kPixel)] = rows - absorbed;
    return balance;
  }

 private:
  struct Row {
    Eigen::RowVectorXd J;
    double r = 0;
    // Unless it stands with others.
    std::optional<NoiseKind> kind;
  };

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
    InertialMatrix covariance, gyro, accel;
    const InertialResidual r = evaluate(rig_.imu_noise, &J, &covariance);
    ImuNoise without = rig_.imu_noise;
    without.accel_noise_density = 0;
    evaluate(without, nullptr, &gyro);
    without = rig_.imu_noise;
    without.gyro_noise_density = 0;
    evaluate(without, nullptr, &accel);
    const InertialMatrix W = SquareRootInformation(covariance);
    by_gyro_.push_back((W * gyro * W.transpose()).topLeftCorner<9, 9>());
    by_accel_.push_back((W * accel * W.transpose()).topLeftCorner<9, 9>());
    const InertialResidual white = W * r;
    const InertialMatrix x0 = W * J.x0, x1 = W * J.x1, by_theta = W * J.theta;
    for (int i = 0; i < 15; ++i) {
      Row& row = AddRow(white(i));
      row.J.segment<15>(15 * link.before) = x0.row(i);
      row.J.segment<15>(15 * link.after) = x1.row(i);
      row.J.segment<15>(theta_column_) = by_theta.row(i);
      if (i >= 9) row.kind = WalkKind(i - 9);
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

  // Of any strength beyond that of the data.
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
    const Eigen::Vector4d point = landmark.place.Homogeneous();
    const int column = landmark_column_ + 3 * static_cast<int>(m);
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
      const double w =
          std::sqrt(landmark.weight * used.weight *
                    loss.Weight(r.squaredNorm()));
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
    const double rho = landmark.place.inverse_depth.z();
    const double scale = std::sqrt(landmark.weight) / kInverseDepthSigma;
    AddRow(scale * rho).J.segment<3>(column) =
        -scale * rho * rho * landmark.place.anchor.R_GA.col(2).transpose();
  }

  const Solved& solved_;
  Rig rig_;
  const Calibration theta_;
  const int theta_column_, landmark_column_, columns_;
  int first_pixel_row_ = 0;
  std::vector<Row> rows_;  // inertial links first
  std::vector<Eigen::Matrix<double, 9, 9>> by_gyro_, by_accel_;
};

void ExpectEqualsDense(const Solved& solved) {
  const std::vector<NoiseFactor> factors =
      EstimateNoiseFactors(solved.Round(), solved.estimate, solved.landmarks);
  ASSERT_EQ(factors.size(), 5u);
  const DenseRound::Balance dense = DenseRound(solved, factors).Count();
  for (const NoiseFactor& factor : factors) {
    SCOPED_TRACE(NoiseKindName(factor.kind));
    const double expected = dense.redundancy[At(factor.kind)];
    EXPECT_NEAR(factor.redundancy, expected, 1e-6 * (1 + expected));
    if (factor.kind == NoiseKind::kPixel) continue;
    // What the factors solve: squares and redundancy balance, but for the weak
    // prior on the factor.
    const double pull = std::log(factor.factor) / std::pow(std::log(10.0), 2);
    EXPECT_NEAR(expected * std::log(dense.squares[At(factor.kind)] / expected),
                pull,
                0.05 / factor.log_sigma);
  }
}

TEST(NoiseFactors, RedundanciesEqualTheDenseOnes) {
  ExpectEqualsDense({NoisyRig(), Walk(NoisyRig(), 2, 12, 50, 1)});
}

TEST(NoiseFactors, RedundanciesOverAGapEqualTheDenseOnes) {
  Rig rig = NoisyRig();
  rig.imu_noise.gyro_bias_random_walk = 1e-2;
  rig.imu_noise.accel_bias_random_walk = 1;
  std::vector<MotionSegment> segments = Walk(rig, 3, 12, 50, 2);
  segments.erase(segments.begin() + 1);
  const Solved solved(rig, std::move(segments));
  EXPECT_EQ(solved.problem.bias_links.size(), 1u);
  ExpectEqualsDense(solved);
}

CalibrationResult CalibrateBelieving(
    const Rig& believed, const std::vector<MotionSegment>& segments) {
  return Calibrate(believed, believed.factory, segments);
}

double FactorOf(const CalibrationResult& result, NoiseKind kind) {
  return result.noise_factors.at(At(kind)).factor;
}

// True noise is `off` times the noise that is believed.
void ExpectFound(const std::vector<NoiseKind>& kinds, double off) {
  const Rig truth = NoisyRig();
  const std::vector<MotionSegment> segments = Walk(truth, 3, 40, 100, 3);
  Rig believed = truth;
  for (const NoiseKind kind : kinds) *NoiseOf(kind, &believed) /= off;
  const CalibrationResult result = CalibrateBelieving(believed, segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged);
  ASSERT_EQ(result.noise_factors.size(), 5u);
  for (const NoiseKind kind :
       {NoiseKind::kPixel, NoiseKind::kGyro, NoiseKind::kAccel}) {
    SCOPED_TRACE(NoiseKindName(kind));
    const bool wrong =
        std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
    EXPECT_TRUE(result.noise_factors[At(kind)].determined());
    EXPECT_NEAR(FactorOf(result, kind) / (wrong ? off : 1), 1, 0.2);
  }
}

TEST(NoiseFactors, AreOneWhereTheRigIsRight) { ExpectFound({}, 1); }

TEST(NoiseFactors, AFactorOfThreeOfThePixelsIsFound) {
  ExpectFound({NoiseKind::kPixel}, 3);
  ExpectFound({NoiseKind::kPixel}, 1.0 / 3);
}

TEST(NoiseFactors, AFactorOfThreeOfTheGyroscopeIsFound) {
  ExpectFound({NoiseKind::kGyro}, 3);
  ExpectFound({NoiseKind::kGyro}, 1.0 / 3);
}

TEST(NoiseFactors, AFactorOfThreeOfTheAccelerometerIsFound) {
  ExpectFound({NoiseKind::kAccel}, 3);
  ExpectFound({NoiseKind::kAccel}, 1.0 / 3);
}

TEST(NoiseFactors, AFactorOfThreeOfAllIsFound) {
  const std::vector<NoiseKind> all = {
      NoiseKind::kPixel, NoiseKind::kGyro, NoiseKind::kAccel};
  ExpectFound(all, 3);
  ExpectFound(all, 1.0 / 3);
}

TEST(NoiseFactors, WhatTheDataDoesNotTellIsSaid) {
  const Rig rig = HandheldRig("r");
  const CalibrationResult result =
      CalibrateBelieving(rig, Walk(rig, 2, 40, 100, 4));
  ASSERT_EQ(result.noise_factors.size(), 5u);
  EXPECT_TRUE(result.noise_factors[At(NoiseKind::kPixel)].determined());
  for (const NoiseKind kind :
       {NoiseKind::kGyroBiasWalk, NoiseKind::kAccelBiasWalk}) {
    EXPECT_FALSE(result.noise_factors[At(kind)].determined());
    EXPECT_LT(result.noise_factors[At(kind)].redundancy, 5);
  }
}

}  // namespace
}  // namespace selfcal
