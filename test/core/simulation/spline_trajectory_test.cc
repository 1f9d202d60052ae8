#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>

#include "core/factor/inertial.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/derivatives.h"

namespace selfcal {
namespace {

using ::testing::HasSubstr;

std::vector<TimedPose> Sampled(const Trajectory& trajectory, double rate_hz) {
  std::vector<TimedPose> poses;
  for (double t = 0; t <= trajectory.duration_s(); t += 1 / rate_hz) {
    const BodyMotion motion = trajectory.At(t);
    // The sign of a quaternion is irrelevant to sensors and files.
    Eigen::Quaterniond q = motion.q_GI;
    if (poses.size() % 3 == 1) q.coeffs() = -q.coeffs();
    poses.push_back({100 + t, q, motion.p_GI});
  }
  return poses;
}

TEST(SplineTrajectoryTest, DerivativesAreThoseOfThePose) {
  const auto poses = Sampled(*MakeHandheld(20, 1, 1), 50);
  const auto spline = MakeSpline(poses);
  ASSERT_NE(spline, nullptr);
  EXPECT_DOUBLE_EQ(spline->duration_s(), poses.back().t_s - poses.front().t_s);
  Random random(1, 0);
  for (int i = 0; i < 1000; ++i) {
    ExpectDerivativesMatch(*spline, random.Uniform(0.1, 19.8));
  }
  // Knots, too, where the polynomials change.
  for (double t = 0.3; t < 19; t += 0.1) ExpectDerivativesMatch(*spline, t);
}

TEST(SplineTrajectoryTest, FollowsASmoothMotionWithItsDerivatives) {
  const auto motion = MakeHandheld(20, 1, 2);
  const auto spline = MakeSpline(Sampled(*motion, 100));
  ASSERT_NE(spline, nullptr);
  double p = 0, q = 0, a = 0, w = 0;
  for (double t = 0.5; t < 19.5; t += 0.013) {
    const BodyMotion x = spline->At(t);
    const BodyMotion truth = motion->At(t);
    p = std::max(p, (x.p_GI - truth.p_GI).norm());
    q = std::max(q, x.q_GI.angularDistance(truth.q_GI));
    a = std::max(a, (x.a_GI - truth.a_GI).norm());
    w = std::max(w, (x.w_I - truth.w_I).norm());
  }
  EXPECT_LT(p, 1e-4);
  EXPECT_LT(q, 1e-4);
  EXPECT_LT(a, 0.05);
  EXPECT_LT(w, 0.005);
}

TEST(SplineTrajectoryTest, SmoothsTheNoiseOfPoses) {
  const auto motion = MakeHandheld(20, 0.5, 3);
  auto poses = Sampled(*motion, 100);
  Random random(1, 0);
  for (TimedPose& pose : poses) pose.p_GI += 1e-3 * random.Normal3();
  const auto spline = MakeSpline(poses);
  ASSERT_NE(spline, nullptr);
  double sum = 0;
  double count = 0;
  for (double t = 0.5; t < 19.5; t += 0.013, ++count) {
    sum += (spline->At(t).a_GI - motion->At(t).a_GI).squaredNorm() / 3;
  }
  // An interpolating spline would have 1e-3 m * sqrt(6) / (0.01 s)^2 = 24
  // m/s^2.
  EXPECT_LT(std::sqrt(sum / count), 0.5);
}

TEST(SplineTrajectoryTest, BridgesAGapSmoothly) {
  const auto motion = MakeHandheld(20, 0.1, 4);
  auto poses = Sampled(*motion, 50);
  poses.erase(poses.begin() + 400, poses.begin() + 450);
  const auto spline = MakeSpline(poses);
  ASSERT_NE(spline, nullptr);
  for (double t = 7.9; t < 9.1; t += 0.01) {
    EXPECT_LT((spline->At(t).p_GI - motion->At(t).p_GI).norm(), 0.05);
    EXPECT_LT(spline->At(t).a_GI.norm(), 5);
  }
}

TEST(SplineTrajectoryTest, RejectsPosesThatAreNoMotion) {
  const std::vector<TimedPose> good = Sampled(*MakeRest(2), 20);
  const auto refusal = [&](auto change, const SplineOptions& options = {}) {
    std::vector<TimedPose> poses = good;
    change(poses);
    std::string error;
    EXPECT_EQ(MakeSpline(poses, options, &error), nullptr);
    EXPECT_EQ(MakeSpline(poses, options), nullptr);
    return error;
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  using Poses = std::vector<TimedPose>;
  EXPECT_THAT(refusal([](Poses& p) { p.resize(3); }), HasSubstr("at least 4"));
  EXPECT_THAT(refusal([](Poses& p) { p[5].t_s = p[4].t_s; }),
              HasSubstr("pose 5"));
  EXPECT_THAT(refusal([](Poses& p) { std::swap(p[5].t_s, p[6].t_s); }),
              HasSubstr("not later"));
  EXPECT_THAT(refusal([](Poses& p) { p[7].t_s = kNan; }), HasSubstr("pose 7"));
  EXPECT_THAT(refusal([](Poses& p) { p[7].p_GI.y() = kNan; }),
              HasSubstr("pose 7"));
  EXPECT_THAT(refusal([](Poses& p) { p[7].q_GI.coeffs() *= 1.1; }),
              HasSubstr("unit quaternion"));
  EXPECT_THAT(refusal([](Poses& p) {
                p[9].q_GI = p[9].q_GI * Eigen::Quaterniond(0, 1, 0, 0);
              }),
              HasSubstr("150 degrees"));
  EXPECT_THAT(refusal([](Poses& p) {
                for (std::size_t i = 20; i < p.size(); ++i) p[i].t_s += 2;
              }),
              HasSubstr("pose 20 at 103 s follows a gap of 2.050 s"));
  EXPECT_THAT(
      refusal([](Poses& p) { p.erase(p.begin() + 3); }, {0.1, 0.1, 0.08}),
      HasSubstr("gap"));
  EXPECT_THAT(refusal([](Poses&) {}, {0, 0.1, 1}), HasSubstr("positive"));
}

// The recordings beside the checkout.
class RecordedMotionTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("SELFCAL_TEST_DATA");
    const std::filesystem::path path =
        std::filesystem::path(folder ? folder : SELFCAL_TEST_DATA_DEFAULT) /
        "trajectories";
    if (!std::filesystem::is_directory(path)) {
      GTEST_SKIP() << "no recordings at " << path
                   << "; set SELFCAL_TEST_DATA to the folder that holds them";
    }
    for (const auto& entry : std::filesystem::directory_iterator(path)) {
      if (entry.path().extension() == ".tum") files_.push_back(entry.path());
    }
    ASSERT_FALSE(files_.empty());
  }

  static std::vector<TimedPose> Read(const std::filesystem::path& path) {
    std::stringstream text;
    text << std::ifstream(path).rdbuf();
    std::vector<TimedPose> poses;
    std::string error;
    EXPECT_TRUE(ParseTum(text.str(), &poses, &error)) << path << ": " << error;
    return poses;
  }

  std::vector<std::filesystem::path> files_;
};

TEST_F(RecordedMotionTest, TheSplineFollowsEveryRecording) {
  for (const auto& path : files_) {
    const auto poses = Read(path);
    std::string error;
    const auto spline = MakeSpline(poses, {}, &error);
    ASSERT_NE(spline, nullptr) << path << ": " << error;
    double p = 0;
    double q = 0;
    const auto n = static_cast<double>(poses.size());
    for (const TimedPose& pose : poses) {
      const BodyMotion x = spline->At(pose.t_s - poses.front().t_s);
      p += (x.p_GI - pose.p_GI).squaredNorm() / n;
      q += std::pow(x.q_GI.angularDistance(pose.q_GI), 2) / n;
    }
    EXPECT_LT(std::sqrt(p), 3e-3) << path;
    EXPECT_LT(std::sqrt(q) * 180 / std::numbers::pi, 0.2) << path;
  }
}

TEST_F(RecordedMotionTest, ReadingsOnTheSplineReproduceItsMotion) {
  for (const auto& path : files_) {
    const auto spline = MakeSpline(Read(path));
    ASSERT_NE(spline, nullptr) << path;
    const Rig rig = HandheldRig("a");
    SimulationOptions options;
    options.noise = false;
    options.landmarks_in_view = 10;
    const SimulatedSession session =
        Simulate(rig, rig.factory, rig.factory, *spline, "recorded", options);
    ASSERT_GT(session.truth.size(), 15u);
    double rotation = 0, velocity = 0, position = 0;
    for (const MotionSegment& truth : session.truth) {
      for (std::size_t k = 0; k + 1 < truth.keyframes.size(); ++k) {
        const InertialResidual r = EvaluateInertial(truth.imu,
                                                    truth.keyframes[k],
                                                    truth.keyframes[k + 1],
                                                    rig.factory.imu,
                                                    rig.imu_noise,
                                                    rig.gravity_mps2,
                                                    nullptr,
                                                    nullptr);
        rotation = std::max(rotation, r.segment<3>(0).norm());
        velocity = std::max(velocity, r.segment<3>(3).norm());
        position = std::max(position, r.segment<3>(6).norm());
      }
    }
    // Over 0.1 s, at the jerkiest moment, linear between samples of 200 Hz.
    EXPECT_LT(rotation, 1e-3) << path;
    EXPECT_LT(velocity, 3e-3) << path;
    EXPECT_LT(position, 2e-4) << path;
  }
}

TEST_F(RecordedMotionTest, SegmentsOnARecordingKeepAllRules) {
  for (const auto& path : files_) {
    const auto spline = MakeSpline(Read(path));
    ASSERT_NE(spline, nullptr) << path;
    const Rig rig = HandheldRig("a");
    const SimulatedSession session =
        Simulate(rig,
                 rig.factory,
                 PerturbCalibration(rig.factory, {}, 1),
                 *spline,
                 "recorded",
                 {});
    EXPECT_FALSE(session.segments.empty()) << path;
    for (const MotionSegment& segment : session.segments) {
      EXPECT_TRUE(Validate(segment, rig.factory).empty()) << path;
      EXPECT_GT(segment.landmarks.size(), 200u) << path;
    }
  }
}

}  // namespace
}  // namespace selfcal
