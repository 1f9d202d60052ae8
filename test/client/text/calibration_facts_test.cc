#include "client/text/calibration_facts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace selfcal::client {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// The texts under a name.
std::vector<std::string> Texts(const v1::Calibration& calibration,
                               const std::string& name) {
  std::vector<std::string> texts;
  for (const Fact& fact : CalibrationFacts(calibration)) {
    if (fact.name == name) texts.push_back(fact.text);
  }
  return texts;
}

v1::NoiseFactor* AddNoise(v1::Calibration* calibration, double used) {
  auto* factor = calibration->mutable_solver()->add_noise_factors();
  factor->set_kind("gyro");
  factor->set_factor(3.02);
  factor->set_log_sigma(0.047);
  factor->set_determined(true);
  factor->set_used(used);
  factor->set_converged(true);
  return factor;
}

TEST(CalibrationFacts, SayWhichNoiseWasUsed) {
  v1::Calibration calibration;
  v1::NoiseFactor* factor = AddNoise(&calibration, 2.97);
  EXPECT_THAT(Texts(calibration, "noise"),
              ElementsAre("gyro noise: residuals suggest 3.02 times what the "
                          "rig states (+- 5 %); 2.97 times was used"));
  factor->set_converged(false);
  EXPECT_THAT(Texts(calibration, "noise"),
              ElementsAre(HasSubstr("did not converge; 2.97 times was used")));
  factor->set_used(0);  // an older version
  EXPECT_THAT(Texts(calibration, "noise"),
              ElementsAre("gyro noise: residuals suggest 3.02 times what the "
                          "rig states (+- 5 %)"));
}

TEST(CalibrationFacts, CountOneOfAKindInTheSingular) {
  v1::Calibration calibration;
  calibration.mutable_provenance()->add_segments("rigs/a/segments/walk~0");
  auto* temperature = calibration.mutable_provenance()->mutable_temperature();
  temperature->set_mean_c(20);
  temperature->set_min_c(19);
  temperature->set_max_c(21);
  v1::SolverReport* solver = calibration.mutable_solver();
  solver->set_segments(1);
  solver->set_partitions(1);
  solver->set_keyframes(40);
  solver->set_landmarks(1);
  solver->set_observations(1);
  EXPECT_THAT(Texts(calibration, "temperature"),
              ElementsAre("20.0 C, 19.0 to 21.0 C (0 of 1 segment)"));
  EXPECT_THAT(Texts(calibration, "problem"),
              ElementsAre("1 segment, 1 partition, 40 keyframes, 1 landmark (0 "
                          "dropped), 1 observation (0 dropped)"));
}

TEST(CalibrationFacts, GiveTheVerdictWithItsReasons) {
  v1::Calibration calibration;
  EXPECT_THAT(Texts(calibration, "verdict"), ElementsAre("unknown"));
  v1::Verdict* verdict = calibration.mutable_verdict();
  verdict->set_kind(v1::Verdict::WEAK);
  verdict->set_text("weak");
  verdict->add_sentences("Hardly learned: cam0.p_CI.z.");
  EXPECT_THAT(Texts(calibration, "verdict"), ElementsAre("weak"));
  EXPECT_THAT(Texts(calibration, "weak because"),
              ElementsAre("Hardly learned: cam0.p_CI.z."));
}

TEST(CalibrationFacts, GiveTheReasonsOfARejectedOneOnce) {
  v1::Calibration calibration;
  calibration.add_reasons("The solver stalled.");
  calibration.mutable_verdict()->set_kind(v1::Verdict::NOT_TRUSTWORTHY);
  calibration.mutable_verdict()->set_text("not trustworthy");
  calibration.mutable_verdict()->add_sentences("The solver stalled.");
  EXPECT_THAT(Texts(calibration, "verdict"), ElementsAre("not trustworthy"));
  EXPECT_THAT(Texts(calibration, "rejected because"),
              ElementsAre("The solver stalled."));
  EXPECT_THAT(Texts(calibration, "note"), IsEmpty());
}

TEST(CalibrationFacts, GiveTheReasonWhyAnActiveOneIsNotTrustworthy) {
  v1::Calibration calibration;
  calibration.mutable_verdict()->set_kind(v1::Verdict::NOT_TRUSTWORTHY);
  calibration.mutable_verdict()->set_text("not trustworthy");
  calibration.mutable_verdict()->add_sentences("The two cores disagree.");
  EXPECT_THAT(Texts(calibration, "not trustworthy because"),
              ElementsAre("The two cores disagree."));
}

TEST(CalibrationFacts, TellAFailedCheckFromOneThatWasNotMade) {
  v1::Calibration calibration;
  auto* check = calibration.mutable_validation()->add_checks();
  check->set_name("halves");
  check->set_outcome(v1::Validation::Check::NOT_TESTED);
  check->set_sentence("There were too few segments.");
  check = calibration.mutable_validation()->add_checks();
  check->set_name("rank");
  check->set_value(0);
  check->set_limit(26);
  check->set_outcome(v1::Validation::Check::FAILED);
  check = calibration.mutable_validation()->add_checks();
  check->set_name("converged");  // of an older daemon
  check->set_value(1);
  check->set_limit(1);
  check->set_passed(true);
  EXPECT_THAT(Texts(calibration, "check"),
              ElementsAre("halves not tested: There were too few segments.",
                          "rank failed: 0, limit 26",
                          "converged passed: 1, limit 1"));
}

TEST(CalibrationFacts, NameSegmentsThatWereExcluded) {
  v1::Calibration calibration;
  calibration.mutable_solver()->add_segment_fits()->set_segment(
      "rigs/a/segments/walk~1");
  auto* fit = calibration.mutable_solver()->add_segment_fits();
  fit->set_segment("rigs/a/segments/walk~2");
  fit->set_excluded("it contradicts the others");
  calibration.mutable_solver()->mutable_halves()->set_degrees(26);
  calibration.mutable_solver()->mutable_halves()->set_chi_square(25.5);
  EXPECT_THAT(Texts(calibration, "excluded segment"),
              ElementsAre("walk~2: it contradicts the others"));
  EXPECT_THAT(Texts(calibration, "halves of the segments"),
              Contains(HasSubstr("25.5 with 26 degrees")));
}

TEST(CalibrationFacts, TellThatTheDeviceMayHaveChanged) {
  v1::Calibration calibration;
  v1::EvictedUse& use = *calibration.mutable_solver()->mutable_evicted();
  use.set_change_probability(0.04);
  EXPECT_THAT(Texts(calibration, "device changed"), IsEmpty());
  use.set_change_probability(0.62);
  EXPECT_THAT(Texts(calibration, "device changed"),
              ElementsAre(HasSubstr("probability 0.62")));
}

}  // namespace
}  // namespace selfcal::client
