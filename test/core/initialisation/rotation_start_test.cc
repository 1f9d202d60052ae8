#include "core/initialisation/rotation_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <vector>

#include "core/model/camera_model.h"
#include "core/model/so3.h"
#include "test/core/initialisation/simulated_tracks.h"
#include "test/core/model/random_values.h"
#include "test/core/simulation/rigs.h"
#include "test/promise.h"
#include "test/swing_trajectory.h"

namespace selfcal {
namespace {

using ::testing::HasSubstr;
using Vector8 = Eigen::Matrix<double, kStartSize, 1>;

// A recording with its truth, and what is believed of the camera.
struct Recording {
  CameraCalibration truth;
  ImuCalibration imu;
  Eigen::Vector3d b_g;
  SimulatedTracks tracks;
};

Recording Record(const Rig& rig,
                 const Trajectory& trajectory,
                 const SimulationOptions& options) {
  return {rig.factory.cameras[0],
          rig.factory.imu,
          options.b_g0,
          SimulateTracksOf(rig, trajectory, options)};
}

// A hand-held device with a random rotation of its camera, and a bias of 0.08
// rad/s as that of EuRoC's.
Recording RecordHandheld(Rig rig, double seconds, SimulationOptions options) {
  RandomValues random(static_cast<unsigned>(options.seed));
  rig.factory.cameras[0].q_CI = random.Rotation();
  options.b_g0 = 0.08 * random.Direction();
  return Record(rig, *MakeHandheld(seconds, 1, options.seed), options);
}

// Nothing is known of q_CI and the time offset.
CameraCalibration Guess(const Recording& recording) {
  CameraCalibration guess = recording.truth;
  guess.q_CI.setIdentity();
  guess.p_CI.setZero();
  guess.time_offset_s = 0;
  return guess;
}

RotationStartResult Find(const Recording& recording,
                         const CameraCalibration& guess,
                         const RotationSearch& options = {}) {
  return FindRotationStart(guess,
                           recording.imu,
                           recording.tracks.images,
                           recording.tracks.samples,
                           options);
}

// Ratio, in the middle of the image, of the focal length of a start by the true
// one.
double FocalRatio(const Recording& recording,
                  const CameraCalibration& guess,
                  const RotationStart& start) {
  return start.focal_scale * PixelsPerRadian(guess).mean() /
         PixelsPerRadian(recording.truth).mean();
}

Vector8 Errors(const Recording& recording,
               const CameraCalibration& guess,
               const RotationStart& start) {
  Vector8 errors;
  errors << Log(recording.truth.q_CI.conjugate() * start.q_CI),
      start.time_offset_s - recording.truth.time_offset_s,
      start.b_g - recording.b_g, std::log(FocalRatio(recording, guess, start));
  return errors;
}

// Each error is within `sigmas` of the stated ones, and small.
void ExpectAccurate(const Recording& recording,
                    const CameraCalibration& guess,
                    const RotationStartResult& result,
                    double max_rotation_rad,
                    double max_offset_s) {
  ASSERT_TRUE(result.start) << result.reason;
  const RotationStart& start = *result.start;
  const Vector8 errors = Errors(recording, guess, start);
  for (int i = 0; i < kStartSize; ++i) {
    EXPECT_LT(std::abs(errors[i]), 5 * start.Sigma(i) + 1e-9) << i;
  }
  EXPECT_LT(errors.segment<3>(kStartRotation).norm(), max_rotation_rad);
  EXPECT_LT(std::abs(errors[kStartTimeOffset]), max_offset_s);
  EXPECT_GT(start.explained, 0.9);
}

std::vector<Eigen::Quaterniond> RightAngleRotations() {
  std::vector<Eigen::Quaterniond> rotations;
  for (int first = 0; first < 3; ++first) {
    for (int second = 0; second < 3; ++second) {
      if (second == first) continue;
      for (const double a : {-1.0, 1.0}) {
        for (const double b : {-1.0, 1.0}) {
          Eigen::Matrix3d R;
          R.col(0) = a * Eigen::Vector3d::Unit(first);
          R.col(1) = b * Eigen::Vector3d::Unit(second);
          R.col(2) = R.col(0).cross(R.col(1));
          rotations.emplace_back(R);
        }
      }
    }
  }
  return rotations;
}

TEST(FindRotationStart, FindsEveryRightAngleRotationAndOffset) {
  const std::array<double, 6> offsets_s = {0, 0.02, 0.1, -0.03, -0.1, 0.14};
  int n = 0;
  for (const Eigen::Quaterniond& q : RightAngleRotations()) {
    SCOPED_TRACE(n);
    Rig rig = HandheldRig("a");
    CameraCalibration& camera = rig.factory.cameras[0];
    camera.q_CI = Exp({0.022, -0.013, 0.031}) * q;
    camera.time_offset_s = offsets_s[n % offsets_s.size()];
    SimulationOptions options = TrackOptions(++n);
    options.b_g0 = {-0.003, 0.021, 0.08};
    const Recording recording = Record(rig, *MakeHandheld(6, 1, n), options);
    const CameraCalibration guess = Guess(recording);
    ExpectAccurate(recording, guess, Find(recording, guess), 0.01, 1e-3);
  }
  EXPECT_EQ(n, 24);
}

// NEES of all components but a focal scale that is not estimated.
double Nees(const Vector8& errors, const RotationStart& start, int size) {
  return errors.head(size).dot(start.covariance.topLeftCorner(size, size)
                                   .ldlt()
                                   .solve(errors.head(size)));
}

TEST(FindRotationStart, ErrorsAreThoseOfTheCovariance) {
  struct Kind {
    const char* name;
    double outlier_fraction;
    double pixel_correlation;
    double line_delay_s;
    bool focal;
  };
  for (const Kind& kind : {Kind{"white noise", 0, 0, 0, false},
                           Kind{"focal length", 0, 0, 0, true},
                           Kind{"outliers", 0.1, 0, 0, true},
                           Kind{"track errors", 0, 0.95, 0, false},
                           Kind{"rolling shutter", 0, 0, 4e-5, true}}) {
    SCOPED_TRACE(kind.name);
    const int size = kind.focal ? kStartSize : kStartSize - 1;
    const int trials = Trials(8);
    double nees = 0;
    Vector8 squares = Vector8::Zero();
    for (int seed = 1; seed <= trials; ++seed) {
      Rig rig = HandheldRig("a");
      rig.factory.cameras[0].time_offset_s = 0.02;
      if (kind.line_delay_s > 0) {
        rig.factory.cameras[0].line_delay_s = kind.line_delay_s;
      }
      SimulationOptions options = TrackOptions(seed);
      options.outlier_fraction = kind.outlier_fraction;
      options.pixel_correlation = kind.pixel_correlation;
      const Recording recording = RecordHandheld(rig, 15, options);
      CameraCalibration guess = Guess(recording);
      if (kind.focal) guess.f *= seed % 2 == 0 ? 0.75 : 1.3;
      const RotationStartResult result =
          Find(recording, guess, {.estimate_focal_scale = kind.focal});
      ASSERT_TRUE(result.start) << seed << ": " << result.reason;
      const Vector8 errors = Errors(recording, guess, *result.start);
      nees += Nees(errors, *result.start, size) / trials;
      squares += errors.cwiseAbs2() / trials;
    }
    std::printf(
        "%s: NEES %.1f of %d; rms of q_CI %.2f mrad, time offset %.2f ms, "
        "b_g %.2f mrad/s, focal length %.2f %%\n",
        kind.name,
        nees,
        size,
        1e3 * std::sqrt(squares.segment<3>(kStartRotation).sum()),
        1e3 * std::sqrt(squares[kStartTimeOffset]),
        1e3 * std::sqrt(squares.segment<3>(kStartGyroBias).sum()),
        1e2 * std::sqrt(squares[kStartFocalScale]));
    // Chi-squared with the variance of a covariance that is itself estimated.
    const double spread = 4 * std::sqrt(2.0 * size / trials);
    EXPECT_LT(nees, 1.25 * size + spread);
    EXPECT_GT(nees, 0.75 * size - spread);
  }
}

TEST(FindRotationStart, FindsTheFocalLengthOfEveryModel) {
  int n = 0;
  for (const DistortionModel model : DistortionModels()) {
    SCOPED_TRACE(DistortionName(model));
    Rig rig = LensRig(model);
    rig.factory.cameras[0].time_offset_s = -0.04;
    const Recording recording = RecordHandheld(rig, 10, TrackOptions(++n));
    CameraCalibration guess = Guess(recording);
    guess.f *= n % 2 == 0 ? 1.3 : 0.77;
    const RotationStartResult result =
        Find(recording, guess, {.estimate_focal_scale = true});
    ExpectAccurate(recording, guess, result, 0.01, 1e-3);
    ASSERT_TRUE(result.start);
    EXPECT_NEAR(FocalRatio(recording, guess, *result.start), 1, 0.005);
    EXPECT_LT(result.start->residual_px, 1.3);
  }
}

// The guess of someone who knows the size of the image alone. The distortion
// that it lacks is of 20 % at the corners, so that no focal length is right.
TEST(FindRotationStart, FocalLengthIsNearlyRightWithoutTheDistortion) {
  for (const double share : {0.8, 1.0, 1.2}) {
    SCOPED_TRACE(share);
    const Recording recording = RecordHandheld(
        LensRig(DistortionModel::kRadialTangential), 15, TrackOptions(3));
    CameraCalibration guess = Guess(recording);
    guess.distortion.setZero();
    guess.f.setConstant(share * guess.width_px);
    guess.c = {320, 320};
    const RotationStartResult result =
        Find(recording, guess, {.estimate_focal_scale = true});
    ASSERT_TRUE(result.start) << result.reason;
    EXPECT_NEAR(FocalRatio(recording, guess, *result.start), 1, 0.15);
    const Vector8 errors = Errors(recording, guess, *result.start);
    EXPECT_LT(errors.segment<3>(kStartRotation).norm(), 0.07);
    EXPECT_LT(std::abs(errors[kStartTimeOffset]), 5e-3);
    // 0.8 px of noise in two images, of which the distance has 1.1 px.
    EXPECT_GT(result.start->residual_px, 2);
  }
}

TEST(FindRotationStart, ResidualShowsWhichModelALensHas) {
  const Recording recording =
      RecordHandheld(HandheldRig("a"), 15, TrackOptions(4));
  CameraCalibration guess = Guess(recording);
  guess.f.setConstant(0.8 * guess.width_px);
  const auto with_model = [&](DistortionModel model) {
    guess.model = model;
    guess.distortion = Undistorted(model);
    return Find(recording, guess, {.estimate_focal_scale = true});
  };
  const RotationStartResult fisheye = with_model(DistortionModel::kEquidistant);
  ASSERT_TRUE(fisheye.start) << fisheye.reason;
  // The distortion of this FOV lens is close to that of an equidistant one.
  EXPECT_NEAR(FocalRatio(recording, guess, *fisheye.start), 1, 0.01);
  const RotationStartResult pinhole =
      with_model(DistortionModel::kRadialTangential);
  ASSERT_TRUE(pinhole.start) << pinhole.reason;
  EXPECT_LT(2 * fisheye.start->residual_px, pinhole.start->residual_px);
}

TEST(FindRotationStart, ARotationThatIsWrongByTenDegreesIsRefined) {
  for (int seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const Recording recording =
        RecordHandheld(HandheldRig("a"), 8, TrackOptions(seed));
    CameraCalibration guess = Guess(recording);
    guess.q_CI =
        recording.truth.q_CI * Exp(0.17 * RandomValues(seed).Direction());
    const RotationStartResult result =
        Find(recording, guess, {.search_rotation = false});
    ExpectAccurate(recording, guess, result, 0.01, 1e-3);
  }
}

// Noise without parallax in the directions of translation would move q_CI by
// 5.6 mrad, root mean square over these seeds, and the focal length by 1.6 %.
TEST(FindRotationStart, IsAccurateForARotationInPlace) {
  constexpr int kSeeds = 8;
  double rotation = 0, focal = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    SimulationOptions options = TrackOptions(seed);
    options.b_g0 = {0.08, -0.01, 0.02};
    const Recording recording =
        Record(HandheldRig("a"),
               *MakeRotationInPlace(15, {.pivot_I = {0.05, 0, 0}}, seed),
               options);
    CameraCalibration guess = Guess(recording);
    guess.f *= 1.2;
    const RotationStartResult result =
        Find(recording, guess, {.estimate_focal_scale = true});
    ExpectAccurate(recording, guess, result, 0.01, 1e-3);
    ASSERT_TRUE(result.start);
    const Vector8 errors = Errors(recording, guess, *result.start);
    rotation += errors.segment<3>(kStartRotation).squaredNorm() / kSeeds;
    focal += std::pow(errors[kStartFocalScale], 2) / kSeeds;
  }
  std::printf("q_CI %.2f mrad, focal length %.2f %%\n",
              1e3 * std::sqrt(rotation),
              1e2 * std::sqrt(focal));
  EXPECT_LT(std::sqrt(rotation), 4e-3);
  EXPECT_LT(std::sqrt(focal), 1.2e-2);
}

TEST(FindRotationStart, SearchesALargerRangeIfAsked) {
  Rig rig = HandheldRig("a");
  rig.factory.cameras[0].time_offset_s = 0.31;
  const Recording recording = RecordHandheld(rig, 8, TrackOptions(2));
  const CameraCalibration guess = Guess(recording);
  ExpectAccurate(recording,
                 guess,
                 Find(recording, guess, {.max_time_offset_s = 0.4}),
                 0.01,
                 1e-3);
}

TEST(FindRotationStart, NoOffsetBeyondTheRangeIsReplacedByAnotherOne) {
  for (const double offset_s : {0.17, 0.2, 0.3, -0.2, -0.4}) {
    SCOPED_TRACE(offset_s);
    Rig rig = HandheldRig("a");
    rig.factory.cameras[0].time_offset_s = offset_s;
    const Recording recording = RecordHandheld(rig, 8, TrackOptions(2));
    const RotationStartResult result = Find(recording, Guess(recording));
    EXPECT_FALSE(result.start);
    EXPECT_THAT(result.reason, HasSubstr("time offset"));
  }
}

// A motion of a device that rotates about the axes with these amplitudes, and
// walks.
Recording RecordSwings(const std::array<Swing, 3>& roll_pitch_yaw,
                       std::uint64_t seed = 1) {
  const std::array<Swing, 3> position = {Swing{0, 0, 0.5, 1.3, 0},
                                         Swing{0, 0, 0.4, 1.7, 1},
                                         Swing{0, 0, 0.2, 2.1, 2}};
  Rig rig = HandheldRig("a");
  rig.factory.cameras[0].time_offset_s = 0.02;
  SimulationOptions options = TrackOptions(seed);
  options.b_g0 = {0.08, -0.01, 0.02};
  return Record(rig, SwingTrajectory(12, position, roll_pitch_yaw), options);
}

TEST(FindRotationStart, OneAxisOfRotationIsNamed) {
  for (int axis = 0; axis < 3; ++axis) {
    SCOPED_TRACE(axis);
    std::array<Swing, 3> swings;
    swings[axis] = {0, 0, 0.5, 2.3, 0};
    const Recording recording = RecordSwings(swings);
    const RotationStartResult result = Find(recording, Guess(recording));
    EXPECT_FALSE(result.start);
    EXPECT_THAT(result.reason, HasSubstr("about one axis only"));
  }
}

TEST(FindRotationStart, OneAxisLeavesAKnownRotationAsUncertainAsItWas) {
  const Recording recording = RecordSwings({Swing{}, {}, {0, 0, 0.5, 2.3, 0}});
  CameraCalibration guess = Guess(recording);
  guess.q_CI = recording.truth.q_CI * Exp({0.03, -0.04, 0.1});
  const RotationStartResult result =
      Find(recording, guess, {.search_rotation = false});
  ASSERT_TRUE(result.start) << result.reason;
  const RotationStart& start = *result.start;
  const Vector8 errors = Errors(recording, guess, start);
  for (int i = 0; i < kStartFocalScale; ++i) {
    EXPECT_LT(std::abs(errors[i]), 5 * start.Sigma(i)) << i;
  }
  EXPECT_LT(start.Sigma(kStartRotation), 0.02);
  EXPECT_NEAR(start.Sigma(kStartRotation + 2), 0.17, 0.02);
  EXPECT_LT(std::abs(errors[kStartTimeOffset]), 2e-3);
}

TEST(FindRotationStart, TwoAxesAreEnough) {
  const Recording recording =
      RecordSwings({Swing{0, 0, 0.4, 2.9, 0}, {0, 0, 0.5, 2.3, 0}, {}});
  const CameraCalibration guess = Guess(recording);
  ExpectAccurate(recording, guess, Find(recording, guess), 0.01, 1e-3);
}

TEST(FindRotationStart, RestAndAConstantRateAreNamed) {
  Recording recording = Record(HandheldRig("a"), *MakeRest(8), TrackOptions(1));
  EXPECT_FALSE(Find(recording, Guess(recording)).start);
  EXPECT_THAT(Find(recording, Guess(recording)).reason,
              HasSubstr("hardly turned"));
  recording = RecordSwings({Swing{}, {}, {0, 0.8, 0, 1, 0}});
  for (const bool search : {true, false}) {
    const RotationStartResult result =
        Find(recording, Guess(recording), {.search_rotation = search});
    EXPECT_FALSE(result.start);
    EXPECT_THAT(result.reason, HasSubstr("constant rate"));
  }
}

// Such a motion, half a period later, is one of a camera that is turned about.
TEST(FindRotationStart, MotionThatRepeatsItselfIsNamed) {
  const double omega = 2 * M_PI / 0.2;
  const Recording recording = RecordSwings({Swing{0, 0, 0.04, omega, 0},
                                            {0, 0, 0.05, omega, 1},
                                            {0, 0, 0.04, omega, 2}});
  CameraCalibration guess = Guess(recording);
  guess.q_CI = recording.truth.q_CI;
  const RotationStartResult result =
      Find(recording, guess, {.search_rotation = false});
  EXPECT_FALSE(result.start);
  EXPECT_THAT(result.reason, HasSubstr("repeats itself"));
}

TEST(FindRotationStart, ReadingsOfAnotherMotionDoNotAgree) {
  Recording recording = RecordHandheld(HandheldRig("a"), 10, TrackOptions(1));
  recording.tracks.samples =
      RecordHandheld(HandheldRig("a"), 10, TrackOptions(2)).tracks.samples;
  const RotationStartResult result = Find(recording, Guess(recording));
  EXPECT_FALSE(result.start);
  EXPECT_THAT(result.reason, HasSubstr("agree"));
}

TEST(FindRotationStart, TooLittleDataIsNamed) {
  Recording recording = RecordHandheld(HandheldRig("a"), 6, TrackOptions(1));
  const CameraCalibration guess = Guess(recording);
  const auto reason = [&] {
    const RotationStartResult result = Find(recording, guess);
    EXPECT_FALSE(result.start);
    return result.reason;
  };
  const SimulatedTracks all = recording.tracks;
  recording.tracks.samples.clear();
  EXPECT_THAT(reason(), HasSubstr("no readings"));
  recording.tracks = all;
  recording.tracks.images.clear();
  EXPECT_THAT(reason(), HasSubstr("too few images"));
  recording.tracks = all;
  for (TrackedImage& image : recording.tracks.images) image.points.resize(5);
  EXPECT_THAT(reason(), HasSubstr("too few images"));
  recording.tracks = all;
  for (ImuSample& sample : recording.tracks.samples) {
    sample.t_ns += 100'000'000'000;
  }
  EXPECT_THAT(reason(), HasSubstr("within the gyroscope's readings"));
}

TEST(FindRotationStart, IgnoresWhatIsNotFiniteNorInOrder) {
  Recording recording = RecordHandheld(HandheldRig("a"), 6, TrackOptions(1));
  const CameraCalibration guess = Guess(recording);
  const RotationStartResult clean = Find(recording, guess);
  ASSERT_TRUE(clean.start) << clean.reason;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<TrackedImage>& images = recording.tracks.images;
  for (TrackedImage& image : images) {
    image.points.push_back({999'999, {nan, 3}});
    image.points.push_back(image.points.front());
    image.points.back().z_px.x() += 50;
  }
  images.insert(images.begin() + 10, images[3]);
  std::vector<ImuSample>& samples = recording.tracks.samples;
  samples.insert(samples.begin() + 50, samples[20]);
  samples.insert(samples.begin() + 70, samples[69]);
  samples[70].gyro.x() = nan;
  const RotationStartResult found = Find(recording, guess);
  ASSERT_TRUE(found.start) << found.reason;
  EXPECT_EQ(found.start->q_CI.coeffs(), clean.start->q_CI.coeffs());
  EXPECT_EQ(found.start->time_offset_s, clean.start->time_offset_s);
  EXPECT_EQ(found.start->covariance, clean.start->covariance);
}

}  // namespace
}  // namespace selfcal
