// A candidate that passes every check, for tests that spoil one thing.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/pipeline/candidate_validation.h"
#include "server/pipeline/verdict.h"
#include "test/server/test_segments.h"

namespace selfcal::server {

class CandidateTest : public ::testing::Test {
 protected:
  explicit CandidateTest(const Rig& rig = TestRig("a")) : rig_(rig) {
    const Eigen::VectorXd prior = PriorSigmas(rig_);
    StoredCalibration& active = evidence_.active;
    active.version = 4;
    active.theta = rig_.factory;
    active.covariance = (0.01 * prior).cwiseAbs2().asDiagonal();
    active.report = CalibrationResult();
    active.report->rank = 20;
    evidence_.diagnosis = Diagnosis();
    evidence_.effects.emplace();
    result_.status = CalibrateStatus::kConverged;
    result_.theta = BoxPlus(rig_.factory, 0.5 * prior);
    result_.covariance = active.covariance;
    result_.rank = 20;
    result_.observations = 9000;
    result_.observations_dropped = 1000;
    result_.reprojection_rms_after_px = 1.4 * rig_.pixel_sigma_px;
    result_.noise_scales = {{NoiseKind::kPixel, 1.02, 0.01, 9e3},
                            {NoiseKind::kGyro, 1.1, 0.05, 400},
                            {NoiseKind::kGyroBiasWalk, 2.5, 0.7, 3}};
    for (int k = 0; k < 8; ++k) {
      result_.segment_fits.push_back({{"s", k}, 1.1, 0.9, {20, 25, 0.7}, ""});
    }
    result_.halves = {24.0, 26, 0.6};
  }

  CandidateValidation Validate() const {
    return ValidateCandidate(rig_, result_, evidence_);
  }
  std::vector<std::string> Problems() const { return Validate().reasons; }
  ValidationCheck Check(const std::string& name) const {
    for (const ValidationCheck& check : Validate().validation.checks) {
      if (check.name == name) return check;
    }
    ADD_FAILURE() << "no check " << name;
    return {};
  }
  CheckOutcome OutcomeOf(const std::string& name) const {
    return Check(name).outcome;
  }
  // The one problem of this result, which is that of this check.
  std::string Problem(const std::string& name) const {
    const auto problems = Problems();
    EXPECT_EQ(problems.size(), 1u) << ::testing::PrintToString(problems);
    EXPECT_EQ(OutcomeOf(name), CheckOutcome::kFailed);
    EXPECT_EQ(Check(name).sentence, problems.empty() ? "" : problems.front());
    return problems.empty() ? std::string() : problems.front();
  }
  Verdict TheVerdict() const { return MakeVerdict(rig_, result_, Validate()); }
  NoiseScale& Factor(NoiseKind kind) {
    for (NoiseScale& factor : result_.noise_scales) {
      if (factor.kind == kind) return factor;
    }
    return result_.noise_scales.emplace_back();
  }
  void Find(FindingKind kind) {
    evidence_.diagnosis->findings.push_back(
        {kind, "the stamps are 19 ms early", "add 19 ms", 0.019});
  }

  Rig rig_;
  CandidateEvidence evidence_;
  CalibrationResult result_;
};

}  // namespace selfcal::server
