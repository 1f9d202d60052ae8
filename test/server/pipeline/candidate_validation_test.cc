#include <cmath>
#include <limits>

#include "test/server/pipeline/candidate_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_F(CandidateTest, SoundOneHasNoProblemAndIsGood) {
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  EXPECT_THAT(TheVerdict().sentences, IsEmpty());
}

TEST_F(CandidateTest, SolverMustHaveConverged) {
  result_.status = CalibrateStatus::kNotConverged;
  result_.iterations = 77;
  EXPECT_THAT(Problem("converged"), HasSubstr("77"));
}

TEST_F(CandidateTest, AStalledSolverHasNotConverged) {
  result_.status = CalibrateStatus::kStalled;
  result_.iterations = 31;
  EXPECT_THAT(Problem("converged"),
              AllOf(HasSubstr("stalled"), HasSubstr("31")));
}

TEST_F(CandidateTest, NumbersMustBeFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  result_.theta.imu.s_g.x() = nan;
  EXPECT_THAT(Problem("usable"), HasSubstr("finite"));
  result_.theta = rig_.factory;
  result_.covariance(2, 3) = nan;
  EXPECT_THAT(Problem("usable"), HasSubstr("finite"));
}

TEST_F(CandidateTest, VariancesMustNotBeNegative) {
  result_.covariance(2, 2) = -1e-12;
  EXPECT_THAT(Problem("usable"), HasSubstr("negative"));
}

TEST_F(CandidateTest, ShapeMustBeThatOfTheRig) {
  result_.covariance = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_THAT(Problem("usable"), HasSubstr("shape"));
  result_.theta.cameras.clear();
  EXPECT_THAT(Problem("usable"), HasSubstr("shape"));
}

// 262 of 45,562: the solver had dropped nearly all landmarks, and converged.
TEST_F(CandidateTest, ACollapseIsRejected) {
  result_.observations = 262;
  result_.observations_dropped = 45'300;
  EXPECT_THAT(Problem("observations_used"),
              AllOf(HasSubstr("262"), HasSubstr("0.6 %")));
  result_.observations = 0;
  result_.observations_dropped = 0;
  EXPECT_THAT(Problem("observations_used"), HasSubstr("0 of 0"));
}

TEST_F(CandidateTest, ManyOutliersAreNoCollapse) {
  result_.observations = 6000;
  result_.observations_dropped = 4000;
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, MostSegmentsMustAgree) {
  for (int k = 0; k < 4; ++k) result_.segment_fits[k].excluded = "contradicts";
  EXPECT_THAT(Problems(), IsEmpty());
  result_.segment_fits[4].excluded = "contradicts";
  EXPECT_THAT(Problem("segments_used"), HasSubstr("5 of 8"));
}

TEST_F(CandidateTest, PixelResidualsMustBeThoseOfTheNoise) {
  result_.reprojection_rms_after_px = 52;
  EXPECT_THAT(Problem("pixel_residuals"), HasSubstr("52"));
  result_.reprojection_rms_after_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(OutcomeOf("pixel_residuals"), CheckOutcome::kFailed);
  // Noise that is larger than the rig says, and was used.
  result_.reprojection_rms_after_px = 6 * rig_.pixel_sigma_px;
  EXPECT_EQ(OutcomeOf("pixel_residuals"), CheckOutcome::kFailed);
  Factor(NoiseKind::kPixel).factor = 4;
  Factor(NoiseKind::kPixel).used = 4;
  EXPECT_THAT(Problems(), IsEmpty());
}

// Each factor is used, and still nothing is good about 59 sigma.
TEST_F(CandidateTest, NoNoiseExplainsResidualsOfFiftyNineSigma) {
  result_.reprojection_rms_after_px = 59 * std::sqrt(2) * rig_.pixel_sigma_px;
  Factor(NoiseKind::kPixel).factor = 59;
  Factor(NoiseKind::kPixel).used = 30;  // no more is ever taken
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kNotTrustworthy);
  Factor(NoiseKind::kPixel).used = 59;
  EXPECT_THAT(Problem("noise"), HasSubstr("59.0 times"));
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kNotTrustworthy);
}

TEST_F(CandidateTest, ASegmentWithASpikeIsRejectedUnlessItIsExcluded) {
  result_.segment_fits[3].inertial_ratio = 893;
  EXPECT_THAT(Problem("segment_residuals"),
              AllOf(HasSubstr("inertial"), HasSubstr("s~3"), HasSubstr("893")));
  result_.segment_fits[3].excluded = "its inertial residuals";
  EXPECT_THAT(Problems(), IsEmpty());
}

// The gyroscope's noise is 3.0 times what the rig states, and was not used.
TEST_F(CandidateTest, NoiseMayNotContradictWhatWasUsed) {
  Factor(NoiseKind::kGyro).factor = 3.0;
  Factor(NoiseKind::kGyro).log_sigma = 0.047;
  EXPECT_THAT(Problem("noise"),
              AllOf(HasSubstr("gyro"), HasSubstr("3.00 times")));
  Factor(NoiseKind::kGyro).used = 2.9;
  EXPECT_THAT(Problems(), IsEmpty());
  // Less noise than the rig states makes sigmas too large, not too small.
  Factor(NoiseKind::kGyro).factor = 0.3;
  Factor(NoiseKind::kGyro).used = 1;
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, NoiseThatIsHardlyDeterminedContradictsIfFarOff) {
  NoiseScale& walk = Factor(NoiseKind::kGyroBiasWalk);
  walk.factor = std::exp(2.9 * walk.log_sigma);
  EXPECT_THAT(Problems(), IsEmpty());
  walk.factor = std::exp(3.1 * walk.log_sigma);
  EXPECT_THAT(Problem("noise"), HasSubstr("gyro_bias_walk"));
}

TEST_F(CandidateTest, NoiseThatWasNotEstimatedIsNotTested) {
  Factor(NoiseKind::kGyro).converged = false;
  EXPECT_EQ(OutcomeOf("noise"), CheckOutcome::kNotTested);
  EXPECT_THAT(Check("noise").sentence, HasSubstr("gyro"));
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
  result_.noise_scales.clear();
  EXPECT_EQ(OutcomeOf("noise"), CheckOutcome::kNotTested);
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
}

TEST_F(CandidateTest, AFindingOfThePreflightRejectsWithItsRemedy) {
  Find(FindingKind::kTimeOffset);
  EXPECT_THAT(Problem("preflight"),
              AllOf(HasSubstr("19 ms early"), HasSubstr("add 19 ms")));
  // Unless the rig estimates it.
  rig_.blocks = {{"*.time_offset", true}};
  EXPECT_EQ(OutcomeOf("preflight"), CheckOutcome::kPassed);
}

Rig TwoImuRig() {
  Rig rig = TestRig("a");
  AddSecondImu(&rig);
  return rig;
}

class TwoImuCandidateTest : public CandidateTest {
 protected:
  TwoImuCandidateTest() : CandidateTest(TwoImuRig()) {}
};

TEST_F(TwoImuCandidateTest, ATimeOffsetRejectsUnlessItIsEstimated) {
  Find(FindingKind::kTimeOffset);
  evidence_.diagnosis->findings.back().imu = 1;
  // That of a camera is another one.
  rig_.blocks = {{"cam0.time_offset", true}};
  EXPECT_THAT(Problem("preflight"), HasSubstr("19 ms early"));
  rig_.blocks = {{"imu1.time_offset", true}};
  EXPECT_EQ(OutcomeOf("preflight"), CheckOutcome::kPassed);
}

TEST_F(CandidateTest, LostSamplesAreNoted) {
  Find(FindingKind::kDroppedSamples);
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  EXPECT_THAT(TheVerdict().sentences,
              ElementsAre(HasSubstr("dropped-samples")));
}

TEST_F(CandidateTest, SegmentsThatCannotBeReadAreNotTested) {
  evidence_.diagnosis.reset();
  EXPECT_EQ(OutcomeOf("preflight"), CheckOutcome::kNotTested);
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
}

TEST_F(CandidateTest, AnEffectThatShiftsItMustBeEstimated) {
  evidence_.effects = {
      {{"cam0.time_offset", {90, 1, 1e-20}, 2.1, "cam0.q_CI.x"},
       {"cam0.line_delay", {70, 1, 1e-16}, 2.4, "cam0.q_CI.y"}}};
  // The most likely one is named.
  EXPECT_THAT(Problem("effects"),
              AllOf(HasSubstr("most likely cam0.time_offset"),
                    HasSubstr("cam0.q_CI.x by 2.1 sigma"),
                    HasSubstr("--block 'cam0.time_offset=on'")));
  evidence_.effects->front().bias_sigmas = 1.9;
  EXPECT_EQ(OutcomeOf("effects"), CheckOutcome::kPassed);
  EXPECT_THAT(Check("effects").sentence, HasSubstr("cam0.time_offset"));
  // What chance may do is no effect.
  evidence_.effects = {{{"cam0.time_offset", {14, 1, 2e-4}, 9, "cam0.q_CI.x"}}};
  EXPECT_EQ(OutcomeOf("effects"), CheckOutcome::kPassed);
  EXPECT_EQ(Check("effects").sentence, "");
  evidence_.effects.reset();
  EXPECT_EQ(OutcomeOf("effects"), CheckOutcome::kNotTested);
}

TEST_F(CandidateTest, AnEffectAlsoShiftsTheActiveVersion) {
  evidence_.effects = {
      {{"cam0.time_offset", {90, 1, 1e-20}, 6, "cam0.q_CI.x"}}};
  // The factory's values were not computed from segments.
  EXPECT_EQ(Validate().of_active, "");
  evidence_.active.run = 3;
  EXPECT_THAT(Validate().of_active,
              AllOf(HasSubstr("cam0.q_CI.x by 6.0 sigma"),
                    HasSubstr("--block 'cam0.time_offset=on'")));
  // It is less certain, and the bias matters less for it.
  evidence_.active.covariance *= 4;
  EXPECT_THAT(Validate().of_active, HasSubstr("cam0.q_CI.x by 3.0 sigma"));
  evidence_.active.covariance *= 10;
  EXPECT_EQ(Validate().of_active, "");
  // Segments that contradict each other may show effects that there are not.
  evidence_.active.covariance = result_.covariance;
  result_.halves = {83.0, 26, 9e-8};
  EXPECT_EQ(Validate().of_active, "");
}

TEST_F(CandidateTest, ValuesMustLieWithinTenPriorSigmasOfTheFactory) {
  const auto components = TangentComponents(rig_.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig_);
  // The focal length: ten prior sigmas of it are still a camera.
  const int k = kImuTangentSize + kCameraIntrinsics;
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(prior.size());
  delta[k] = 9.99 * prior[k];
  result_.theta = BoxPlus(rig_.factory, delta);
  EXPECT_THAT(Problems(), IsEmpty());
  delta[k] = 10.01 * prior[k];
  result_.theta = BoxPlus(rig_.factory, delta);
  EXPECT_THAT(Problem("prior_sigmas"), HasSubstr(components[k].name));
}

// Three tolerances off in what is shown; every second component is held
// constant, with the uncertainty of its tolerance.
TEST_F(CandidateTest, DataMustAgreeWithThePriorUnlessItDecidesAlone) {
  const Eigen::VectorXd prior = PriorSigmas(rig_);
  result_.theta = BoxPlus(rig_.factory, 3 * prior);
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(Check("prior_agreement").value, 1);
  const std::vector<int> free = FreeComponents(rig_);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(prior.size());
  Eigen::VectorXd sigmas = Eigen::VectorXd::Zero(prior.size());
  int held = 0;
  for (std::size_t k = 0; k < free.size(); ++k) {
    const int component = free[k];
    const bool shown = k % 2 == 0;
    offset(component) = shown ? 3 * prior(component) : 0;
    sigmas(component) = (shown ? 0.5 : 1) * prior(component);
    held += shown ? 0 : 1;
  }
  result_.theta = BoxPlus(rig_.factory, offset);
  result_.covariance = sigmas.cwiseAbs2().asDiagonal();
  evidence_.active.covariance = result_.covariance;
  const std::string problem = Problem("prior_agreement");
  EXPECT_THAT(problem, HasSubstr("prior_sigmas"));
  // Of a difference of 3 tolerances, and a sigma of 0.5 beside that of the
  // prior: 2.7 times as far as expected.
  EXPECT_THAT(problem, HasSubstr("2.7 times as far"));
  EXPECT_NEAR(Check("prior_agreement").value,
              std::sqrt(1 + (9 / 1.25 - 1) * held / std::ssize(free)),
              0.01);
  // After a device change another prior was used.
  evidence_.has_factory_prior = false;
  EXPECT_THAT(Problems(), IsEmpty());
  evidence_.has_factory_prior = true;
  result_.theta = BoxPlus(rig_.factory, 0.5 * prior);
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(Check("prior_agreement").value, 1);
}

// A device of another cohort, to which a prior was given: its data shows the
// factory calibration, three sigmas from the mean.
TEST_F(CandidateTest, DataMustAgreeWithThePriorMean) {
  const Eigen::VectorXd prior = PriorSigmas(rig_);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(prior.size());
  Eigen::VectorXd sigmas = Eigen::VectorXd::Zero(prior.size());
  bool is_shown = false;
  for (const int k : FreeComponents(rig_)) {
    is_shown = !is_shown;
    offset(k) = 3 * prior(k);
    sigmas(k) = (is_shown ? 0.5 : 1) * prior(k);
  }
  result_.theta = rig_.factory;
  result_.covariance = sigmas.cwiseAbs2().asDiagonal();
  evidence_.active.covariance = result_.covariance;
  EXPECT_THAT(Problems(), IsEmpty());
  rig_.prior_mean = BoxPlus(rig_.factory, offset);
  EXPECT_THAT(Problem("prior_agreement"),
              HasSubstr("as far from the prior mean"));
  EXPECT_NEAR(Check("prior_sigmas").value, 3, 1e-9);
}

TEST_F(CandidateTest, ValuesMustBeThoseOfACalibration) {
  rig_.prior_sigmas = {{"*", 1e6}};
  result_.theta.cameras[0].f.x() = -5;
  EXPECT_EQ(OutcomeOf("usable"), CheckOutcome::kFailed);
}

TEST_F(CandidateTest, RankMayNotFall) {
  result_.rank = 19;
  EXPECT_THAT(Problem("rank"), AllOf(HasSubstr("19"), HasSubstr("20")));
  // By what a change of the device takes away.
  evidence_.changed = {15, 16, 17};
  result_.rank = 17;
  EXPECT_THAT(Problems(), IsEmpty());
  result_.rank = 16;
  EXPECT_THAT(Problem("rank"), HasSubstr("16"));
  // The factory's version observes nothing.
  evidence_.active.report.reset();
  result_.rank = 1;
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, SigmaMayNotGrowByMoreThanHalf) {
  const double before = evidence_.active.covariance(5, 5);
  result_.covariance(5, 5) = before * 1.49 * 1.49;
  EXPECT_THAT(Problems(), IsEmpty());
  result_.covariance(5, 5) = before * 1.51 * 1.51;
  EXPECT_THAT(Problem("sigma_growth"),
              HasSubstr(TangentComponents(rig_.factory)[5].name));
}

// The estimate knows as much as before; the device may have changed since.
TEST_F(CandidateTest, TheChanceOfAChangeIsNoLossOfCertainty) {
  const double before = evidence_.active.covariance(5, 5);
  result_.covariance(5, 5) = 3 * before;
  EXPECT_NE(Problem("sigma_growth"), "");
  result_.remembered.change_sigmas =
      Eigen::VectorXd::Zero(result_.covariance.rows());
  result_.remembered.change_sigmas(5) = std::sqrt(2 * before);
  EXPECT_THAT(Problems(), IsEmpty());
}

// A mild loss was rejected, and a total one accepted.
TEST_F(CandidateTest, WhatWasKnownMayNotBeLost) {
  const double prior = PriorSigmas(rig_)[5];
  result_.covariance(5, 5) = prior * prior;
  EXPECT_THAT(Problem("sigma_growth"),
              HasSubstr(TangentComponents(rig_.factory)[5].name));
  // The factory's version knows nothing that could be lost.
  evidence_.active.covariance = PriorSigmas(rig_).cwiseAbs2().asDiagonal();
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, FiguresAreKeptWithTheirLimits) {
  result_.covariance(5, 5) = evidence_.active.covariance(5, 5) * 4;
  result_.status = CalibrateStatus::kNotConverged;
  const ValidationCheck growth = Check("sigma_growth");
  EXPECT_NEAR(growth.value, 2, 1e-9);
  EXPECT_EQ(growth.limit, 1.5);
  EXPECT_EQ(growth.outcome, CheckOutcome::kFailed);
  EXPECT_EQ(OutcomeOf("converged"), CheckOutcome::kFailed);
  EXPECT_EQ(OutcomeOf("usable"), CheckOutcome::kPassed);
  EXPECT_NEAR(Check("prior_sigmas").value, 0.5, 1e-9);
  EXPECT_NEAR(Check("observations_used").value, 0.9, 1e-12);
  EXPECT_EQ(Validate().validation.active_version, 4);
}

TEST_F(CandidateTest, FixedComponentsAreNotLookedAt) {
  rig_.fixed = {"imu.accel.scale.*"};
  result_.covariance(6, 6) = 0;
  evidence_.active.covariance(6, 6) = 0;
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
}

TEST_F(CandidateTest, HalvesMustAgree) {
  result_.halves = {83.0, 26, 9e-8};
  EXPECT_THAT(Problem("halves"), AllOf(HasSubstr("83"), HasSubstr("9.0e-08")));
}

// Of eight segments: what is too much depends on how much was compared.
TEST_F(CandidateTest, SegmentsMustAgreeAsFarAsNoiseAllows) {
  const auto compare = [&](int degrees, double excess) {
    for (SegmentFit& fit : result_.segment_fits) {
      fit.others = {excess * degrees, degrees, 0.5};
    }
    return OutcomeOf("disagreement");
  };
  EXPECT_EQ(compare(4, 9), CheckOutcome::kNotTested);
  EXPECT_EQ(compare(8, 1.55), CheckOutcome::kPassed);  // 64: up to 1.63
  EXPECT_EQ(compare(8, 1.7), CheckOutcome::kFailed);
  EXPECT_EQ(compare(26, 1.32), CheckOutcome::kPassed);  // 208: up to 1.33
  EXPECT_EQ(compare(26, 1.4), CheckOutcome::kFailed);
  EXPECT_EQ(compare(200, 1.29), CheckOutcome::kPassed);
  EXPECT_EQ(compare(200, 1.31), CheckOutcome::kFailed);
  EXPECT_THAT(Problem("disagreement"), HasSubstr("1.31 times the variance"));
}

// What looks like noise of the IMU may act on all segments alike.
TEST_F(CandidateTest, SegmentsMustAgreeBetterIfTheImuSeemsNoisy) {
  const auto compare = [&](NoiseKind kind, double used, double excess) {
    result_.noise_scales = {
        {.kind = kind, .factor = used, .log_sigma = 0.05, .used = used}};
    for (SegmentFit& fit : result_.segment_fits) {
      fit.others = {excess * 26, 26, 0.5};
    }
    return OutcomeOf("disagreement");
  };
  // 208 degrees: chance exceeds 1.24 once in a hundred times.
  EXPECT_EQ(compare(NoiseKind::kGyro, 1.9, 1.27), CheckOutcome::kPassed);
  EXPECT_EQ(compare(NoiseKind::kGyro, 2.1, 1.27), CheckOutcome::kFailed);
  EXPECT_EQ(compare(NoiseKind::kSecondAccel, 2.1, 1.27), CheckOutcome::kFailed);
  EXPECT_EQ(compare(NoiseKind::kGyro, 2.1, 1.2), CheckOutcome::kPassed);
  EXPECT_EQ(compare(NoiseKind::kPixel, 2.1, 1.27), CheckOutcome::kPassed);
  EXPECT_EQ(compare(NoiseKind::kGyroBiasWalk, 2.1, 1.27),
            CheckOutcome::kPassed);
}

TEST_F(CandidateTest, MostSegmentsWithoutDataMustAgree) {
  result_.remembered.compared = 9;
  result_.remembered.contradicting = 4;
  EXPECT_EQ(OutcomeOf("remembered"), CheckOutcome::kPassed);
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  result_.remembered.contradicting = 5;
  EXPECT_THAT(Problem("remembered"), HasSubstr("5 of 9"));
  // One wrong segment is no majority.
  result_.remembered.compared = 1;
  result_.remembered.contradicting = 1;
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, SegmentsWithoutDataThatContradictItTogetherMakeItWeak) {
  result_.remembered.compared = 9;
  result_.remembered.agreement = {30, 26, 0.3};
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  result_.remembered.agreement = {83, 26, 9e-8};
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
  EXPECT_THAT(TheVerdict().sentences, ElementsAre(HasSubstr("83.0 with 26")));
}

TEST_F(CandidateTest, WithoutAnyTestOfOtherDataItIsNotConfirmed) {
  result_.halves = {};
  EXPECT_EQ(OutcomeOf("halves"), CheckOutcome::kNotTested);
  EXPECT_EQ(OutcomeOf("held_out_probability"), CheckOutcome::kNotTested);
  EXPECT_THAT(Problem("confirmed"), HasSubstr("more motion"));
}

}  // namespace
}  // namespace selfcal::server
