// Simulated segments of a device whose rig has a prior mean, calibrated by the
// estimators of core: the mean of its cohort, a wrong one, and the factory
// calibration.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"
#include "test/core/information/simple_motions.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Halves of fewer segments are not tested (kLeastToAgree), so that nothing
// would confirm a candidate.
constexpr int kSegments = 4;
constexpr double kDuration_s = 4 * kSegments + 1;
// Standard deviation of a device about the mean of its cohort, and distance of
// that mean from the factory calibration, in factory tolerances.
constexpr double kSpread = 0.2;
constexpr double kMeanOffset = 0.5;
// Error of a wrong mean, in spreads of the cohort: below the limit of the check
// prior_sigmas, which would reject the truth.
constexpr double kWrong = 8;
// Excitation of the motion.
constexpr double kCalm = 0.1;
constexpr double kVigorous = 0.5;
// Largest error of a component of a sound estimate, in sigmas: one of the 26
// is larger by chance in 0.2 % of devices. And that of any active version.
constexpr double kSound = 4;
constexpr double kNeverActive = 5;

// Tolerances as large as the errors of a factory calibration.
Rig ToleranceRig() {
  const CalibrationError error;
  Rig rig = HandheldRig("factory");
  const CameraCalibration& camera = rig.factory.cameras[0];
  rig.prior_sigmas = {
      {"*.scale.*", error.scale},
      {"*.misalignment.*", error.misalignment},
      {"imu.q_AI.*", error.accel_rotation_rad},
      {"*.q_CI.*", error.camera_rotation_rad},
      {"*.p_CI.*", error.camera_position_m},
      {"*.focal.*", error.focal_relative * camera.f.x()},
      {"*.principal.*", error.principal_point_px},
      {"*.distortion.*", error.distortion_relative * camera.distortion[0]}};
  // Every segment of a test enters the tables, and only the test starts runs.
  rig.min_gain_nats = 0;
  rig.table_size = 10 * kSegments;
  return rig;
}

// A device of a cohort. Vectors are in tangent units; the means and the device
// are offsets from the factory calibration.
struct CohortDevice {
  Rig rig;  // with the factory's tolerances and without a prior mean
  Eigen::VectorXd spread;
  Eigen::VectorXd mean;
  Eigen::VectorXd offset;
  Calibration truth;
};

CohortDevice DrawDevice(std::uint64_t seed) {
  CohortDevice device;
  device.rig = ToleranceRig();
  const Eigen::VectorXd tolerance = PriorSigmas(device.rig);
  device.spread = Eigen::VectorXd::Zero(tolerance.size());
  device.mean = device.spread;
  device.offset = device.spread;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  double sign = 1;
  for (const int i : FreeComponents(device.rig)) {
    device.spread(i) = kSpread * tolerance(i);
    device.mean(i) = sign * kMeanOffset * tolerance(i);
    device.offset(i) = device.mean(i) + device.spread(i) * normal(random);
    sign = -sign;
  }
  device.truth = BoxPlus(device.rig.factory, device.offset);
  return device;
}

// The rig of the device with the prior of a cohort: this mean, and the spread
// as its tolerances.
Rig DescribedRig(const CohortDevice& device, const Eigen::VectorXd& mean) {
  Rig rig = device.rig;
  rig.id = "described";
  rig.prior_mean = BoxPlus(rig.factory, mean);
  rig.prior_sigmas.clear();
  const auto components = TangentComponents(rig.factory);
  for (const int i : FreeComponents(rig)) {
    rig.prior_sigmas.push_back({components[i].name, device.spread(i)});
  }
  return rig;
}

// The mean of the cohort, but for these components, where it is wrong.
Eigen::VectorXd WrongMean(const CohortDevice& device,
                          const std::vector<int>& wrong) {
  Eigen::VectorXd mean = device.mean;
  for (const int i : wrong) {
    mean(i) = device.offset(i) + kWrong * device.spread(i);
  }
  return mean;
}

std::vector<int> Components(const CohortDevice& device,
                            const std::vector<std::string>& names) {
  return MatchComponents(TangentComponents(device.rig.factory), names);
}

// Two of its camera, which motion shows.
std::vector<int> WrongComponents(const CohortDevice& device) {
  std::vector<int> wrong =
      Components(device, {"cam0.focal.x", "cam0.principal.x"});
  EXPECT_EQ(wrong.size(), 2u);
  return wrong;
}

std::vector<MotionSegment> SegmentsOf(const CohortDevice& device,
                                      const Trajectory& motion,
                                      std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  return Simulate(device.rig,
                  device.truth,
                  device.rig.factory,
                  motion,
                  "session",
                  options)
      .segments;
}

std::vector<MotionSegment> HandheldSegments(const CohortDevice& device,
                                            double excitation,
                                            std::uint64_t seed) {
  return SegmentsOf(device, *MakeHandheld(kDuration_s, excitation, seed), seed);
}

// A component of a version. Value and truth are offsets from the factory
// calibration.
struct ComponentError {
  int index = 0;
  std::string component;
  double value = 0;
  double truth = 0;
  double error = 0;
  double sigma = 0;

  double InSigmas() const { return std::abs(error) / sigma; }
};

std::ostream& operator<<(std::ostream& out, const ComponentError& one) {
  return out << one.component << ": value " << one.value << ", truth "
             << one.truth << ", error " << one.error << ", sigma " << one.sigma;
}

// Those of all components that are estimated, in the order of the tangent.
std::vector<ComponentError> ErrorsOf(const CohortDevice& device,
                                     const StoredCalibration& version) {
  const auto components = TangentComponents(device.rig.factory);
  const Eigen::VectorXd value = BoxMinus(version.theta, device.rig.factory);
  const Eigen::VectorXd error = BoxMinus(version.theta, device.truth);
  std::vector<ComponentError> errors;
  for (const int i : FreeComponents(device.rig)) {
    errors.push_back({i,
                      components[i].name,
                      value(i),
                      device.offset(i),
                      error(i),
                      std::sqrt(version.covariance(i, i))});
  }
  return errors;
}

ComponentError Worst(const std::vector<ComponentError>& errors) {
  return *std::max_element(
      errors.begin(), errors.end(), [](const auto& a, const auto& b) {
        return a.InSigmas() < b.InSigmas();
      });
}

// The check of this name, which must have been stored.
ValidationCheck CheckOf(const StoredCalibration& version,
                        const std::string& name) {
  for (const ValidationCheck& check : version.validation->checks) {
    if (check.name == name) return check;
  }
  ADD_FAILURE() << "no check " << name;
  return {};
}

// Expects a sound estimate, or a rejection by the check of the prior.
void ExpectSoundOrRejected(const CohortDevice& device,
                           const StoredCalibration& version) {
  const ComponentError worst = Worst(ErrorsOf(device, version));
  const ValidationCheck check = CheckOf(version, "prior_agreement");
  if (version.state == CalibrationState::kActive) {
    EXPECT_LT(worst.InSigmas(), kNeverActive) << worst;
  }
  if (check.outcome != CheckOutcome::kFailed) {
    EXPECT_LT(worst.InSigmas(), kSound)
        << worst << "; prior_agreement " << check.value << ", reasons "
        << ::testing::PrintToString(version.reasons);
    return;
  }
  EXPECT_EQ(version.state, CalibrationState::kRejected);
  EXPECT_THAT(version.reasons,
              Contains(AllOf(HasSubstr("The segments contradict the prior"),
                             HasSubstr("from the prior mean"))));
}

class PriorMeanTest : public PipelineTest {
 protected:
  PriorMeanTest() {
    estimators_ = CoreEstimators();
    StartOne();
  }

  // `version` becomes the result of the first run of this rig, on all segments.
  void CalibrateOn(const Rig& rig,
                   const std::vector<MotionSegment>& segments,
                   StoredCalibration* version) {
    ASSERT_EQ(segments.size(), static_cast<std::size_t>(kSegments));
    const auto created = domain_->CreateRig(rig);
    ASSERT_TRUE(created.ok()) << created.status();
    for (const MotionSegment& segment : segments) {
      const auto result = pipeline_->Submit(rig.id, segment, nullptr);
      ASSERT_TRUE(result.ok()) << result.status();
      ASSERT_EQ(result->verdict, SubmitResult::Verdict::kStored)
          << result->violations.front().field;
    }
    ASSERT_TRUE(AllScored());
    const auto run = pipeline_->StartRecalibration(rig.id, true);
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_EQ(run->segments.size(), segments.size());
    ASSERT_TRUE(
        Eventually([&] { return store_->ListUnfinishedRuns()->empty(); }));
    const auto stored = store_->GetCalibration(rig.id, 2);
    ASSERT_TRUE(stored.ok())
        << stored.status() << ": " << store_->GetRun(rig.id, run->run)->message;
    ASSERT_TRUE(stored->validation.has_value());
    ASSERT_TRUE(SameShape(stored->theta, rig.factory));
    *version = *stored;
  }
};

// Calm motion hardly shows some components, which the cohort knows.
TEST_F(PriorMeanTest, TheMeanOfItsCohortImprovesHardlyObservedComponents) {
  const CohortDevice device = DrawDevice(1);
  const auto segments = HandheldSegments(device, kCalm, 1);
  StoredCalibration described, alone;
  ASSERT_NO_FATAL_FAILURE(
      CalibrateOn(DescribedRig(device, device.mean), segments, &described));
  ASSERT_NO_FATAL_FAILURE(CalibrateOn(device.rig, segments, &alone));
  EXPECT_EQ(described.state, CalibrationState::kActive);
  EXPECT_THAT(described.reasons, IsEmpty());
  const std::vector<ComponentError> with_cohort = ErrorsOf(device, described);
  const std::vector<ComponentError> with_factory = ErrorsOf(device, alone);
  for (const ComponentError& one : with_cohort) {
    EXPECT_LT(one.InSigmas(), kSound) << one;
  }
  // Squares over those components, in spreads of the cohort.
  double squares = 0;
  double squares_alone = 0;
  int hardly_shown = 0;
  for (std::size_t k = 0; k < with_factory.size(); ++k) {
    const double spread = device.spread(with_factory[k].index);
    if (with_factory[k].sigma < 1.5 * spread) continue;
    ++hardly_shown;
    EXPECT_LT(with_cohort[k].sigma, with_factory[k].sigma) << with_cohort[k];
    squares += std::pow(with_cohort[k].error / spread, 2);
    squares_alone += std::pow(with_factory[k].error / spread, 2);
  }
  EXPECT_GE(hardly_shown, 3);
  EXPECT_LT(squares, squares_alone);
}

TEST_F(PriorMeanTest, AWrongMeanIsOverruledByTheData) {
  const CohortDevice device = DrawDevice(2);
  const std::vector<int> wrong = WrongComponents(device);
  StoredCalibration version;
  ASSERT_NO_FATAL_FAILURE(
      CalibrateOn(DescribedRig(device, WrongMean(device, wrong)),
                  HandheldSegments(device, kVigorous, 2),
                  &version));
  for (const ComponentError& one : ErrorsOf(device, version)) {
    if (std::find(wrong.begin(), wrong.end(), one.index) == wrong.end()) {
      continue;
    }
    // A verdict treats a component above this share of the prior's sigma as
    // hardly learned.
    EXPECT_LT(one.sigma, 0.5 * device.spread(one.index)) << one;
    EXPECT_LT(one.InSigmas(), kSound) << one;
  }
  ExpectSoundOrRejected(device, version);
}

TEST_F(PriorMeanTest, AWrongMeanGivesNoUnsoundVersionOfCalmMotion) {
  const CohortDevice device = DrawDevice(3);
  const std::vector<int> wrong = WrongComponents(device);
  StoredCalibration version;
  ASSERT_NO_FATAL_FAILURE(
      CalibrateOn(DescribedRig(device, WrongMean(device, wrong)),
                  HandheldSegments(device, kCalm, 3),
                  &version));
  ExpectSoundOrRejected(device, version);
}

// The limit of what a device can notice: on level ground it never turns about
// the x axis of its gyroscope, whose scale multiplies a rate of zero. No test
// of the data can find that error, and the version claims no knowledge of it.
TEST_F(PriorMeanTest, AWrongMeanOfAnUnobservedComponentKeepsThePriorSigma) {
  const CohortDevice device = DrawDevice(4);
  const std::vector<int> wrong = Components(device, {"imu.gyro.scale.x"});
  ASSERT_EQ(wrong.size(), 1u);
  const int scale = wrong.front();
  const Eigen::VectorXd mean = WrongMean(device, wrong);
  std::mt19937 random(4);
  const std::unique_ptr<Trajectory> level =
      RandomMotion(MotionKind::kPlanar, kDuration_s, &random);
  StoredCalibration version;
  ASSERT_NO_FATAL_FAILURE(CalibrateOn(
      DescribedRig(device, mean), SegmentsOf(device, *level, 4), &version));
  for (const ComponentError& one : ErrorsOf(device, version)) {
    if (one.index != scale) {
      EXPECT_LT(one.InSigmas(), kNeverActive) << one;
      continue;
    }
    // An angle of 0.14 between the component and what is held constant would
    // take away a hundredth of the sigma.
    EXPECT_GT(one.sigma, 0.99 * device.spread(scale)) << one;
    EXPECT_NEAR(one.value, mean(scale), device.spread(scale)) << one;
  }
  const ValidationCheck check = CheckOf(version, "prior_agreement");
  EXPECT_EQ(check.outcome, CheckOutcome::kPassed) << check.sentence;
  EXPECT_EQ(check.value, 1);
  EXPECT_EQ(version.state, CalibrationState::kActive)
      << ::testing::PrintToString(version.reasons);
  EXPECT_EQ(version.verdict.kind, VerdictKind::kWeak);
  EXPECT_THAT(version.verdict.sentences,
              Contains(HasSubstr("Hardly learned: imu.gyro.scale.x")));
}

TEST_F(PriorMeanTest, TheFactoryCalibrationAsMeanChangesNothing) {
  const CohortDevice device = DrawDevice(5);
  const auto segments = HandheldSegments(device, kVigorous, 5);
  Rig with_mean = device.rig;
  with_mean.id = "with-mean";
  with_mean.prior_mean = with_mean.factory;
  StoredCalibration with, without;
  ASSERT_NO_FATAL_FAILURE(CalibrateOn(with_mean, segments, &with));
  ASSERT_NO_FATAL_FAILURE(CalibrateOn(device.rig, segments, &without));
  EXPECT_EQ(with.state, without.state);
  EXPECT_EQ(ReadableValues(with.theta), ReadableValues(without.theta));
  EXPECT_EQ(with.covariance, without.covariance);
  ASSERT_EQ(with.validation->checks.size(), without.validation->checks.size());
  for (const ValidationCheck& check : without.validation->checks) {
    const ValidationCheck same = CheckOf(with, check.name);
    EXPECT_EQ(same.value, check.value) << check.name;
    EXPECT_EQ(same.outcome, check.outcome) << check.name;
  }
}

}  // namespace
}  // namespace selfcal::server
