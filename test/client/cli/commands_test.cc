// The commands that show and change what the daemon has.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;

TEST_F(Commands, WrongUsageExitsWithTwo) {
  for (const std::vector<std::string>& line :
       std::vector<std::vector<std::string>>{{},
                                             {"nonsense"},
                                             {"rig"},
                                             {"rig", "show"},
                                             {"rig", "create"},
                                             {"rig", "list", "--nonsense"},
                                             {"import", "a"},
                                             {"import", "a", "/nowhere"},
                                             {"rig", "create", "/nowhere"}}) {
    const Outcome outcome = Selfcal(line);
    EXPECT_EQ(outcome.code, 2) << testing::PrintToString(line);
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err, "");
  }
}

TEST_F(Commands, HelpIsNoError) {
  EXPECT_EQ(Selfcal({"--help"}).code, 0);
  EXPECT_THAT(Selfcal({"import", "--help"}).out, HasSubstr("--keyframes"));
}

TEST(CommandsAlone, ADaemonThatIsAwayExitsWithThree) {
  const std::string target = "unix:" + testing::TempDir() + "nobody.sock";
  for (const std::vector<std::string>& line :
       std::vector<std::vector<std::string>>{{"rig", "list"},
                                             {"rig", "show", "a"},
                                             {"segments", "list", "a"},
                                             {"segments", "show", "a", "b~0"},
                                             {"tables", "a"},
                                             {"recalibrate", "a"},
                                             {"calibrations", "list", "a"},
                                             {"calibrations", "show", "a"},
                                             {"calibrations", "watch", "a"}}) {
    std::vector<std::string> with_target = line;
    with_target.insert(with_target.end(), {"--target", target});
    const Outcome outcome = Selfcal(with_target);
    EXPECT_EQ(outcome.code, 3) << testing::PrintToString(line);
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, HasSubstr("Is selfcald running?"));
    EXPECT_THAT(outcome.err, HasSubstr(target));
  }
}

TEST_F(Commands, QuarantinesASegmentOrASession) {
  const Outcome one = Selfcal({"segments",
                               "quarantine",
                               "device",
                               "walk%201~7",
                               "--reason",
                               "diverged"});
  EXPECT_EQ(one.code, 0) << one.err;
  EXPECT_THAT(one.out, HasSubstr("quarantined\t3\n"));
  EXPECT_EQ(daemon_.last_quarantine.parent(), "rigs/device");
  EXPECT_EQ(daemon_.last_quarantine.session(), "walk 1");
  EXPECT_EQ(daemon_.last_quarantine.index(), 7);
  EXPECT_EQ(daemon_.last_quarantine.reason(), "diverged");
  EXPECT_EQ(
      Selfcal({"segments", "quarantine", "device", "walk", "--reason", "x"})
          .code,
      0);
  EXPECT_EQ(daemon_.last_quarantine.session(), "walk");
  EXPECT_FALSE(daemon_.last_quarantine.has_index());
  EXPECT_EQ(Selfcal({"segments", "quarantine", "device", "walk"}).code, 2);
  EXPECT_EQ(
      Selfcal({"segments", "quarantine", "device", "walk~x", "--reason", "x"})
          .code,
      2);
}

TEST_F(Commands, ListsWhatIsQuarantinedWithWhy) {
  v1::Segment segment;
  segment.set_name("rigs/device/segments/walk~7");
  segment.set_state(v1::Segment::UNUSABLE);
  segment.set_problem("quarantined by alice: diverged");
  daemon_.segments = {segment};
  const Outcome outcome =
      Selfcal({"segments", "list", "device", "--quarantined"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "state = UNUSABLE");
  EXPECT_THAT(outcome.out, HasSubstr("walk~7"));
  EXPECT_THAT(outcome.out, HasSubstr("quarantined by alice: diverged"));
}

TEST_F(Commands, TheGradeOfAnImuSetsItsTolerances) {
  v1::Rig rig = ToProto(ARig("from_file"));
  v1::ComponentSetting* own = rig.add_prior_sigmas();
  own->set_pattern("imu.gyro.scale.x");
  own->set_value(0.5);
  const std::string file = WriteFile(ToJson(rig, false));
  ASSERT_EQ(Selfcal({"rig", "create", file, "--imu", "consumer"}).code, 0);
  const auto& sigmas = daemon_.rigs.back().prior_sigmas();
  ASSERT_GT(sigmas.size(), 1);
  EXPECT_EQ(sigmas[0].pattern(), "imu.gyro.scale.*");
  EXPECT_EQ(sigmas[0].value(), 0.02);
  EXPECT_EQ(sigmas[sigmas.size() - 1].pattern(), "imu.gyro.scale.x");
  const Outcome wrong = Selfcal({"rig", "create", file, "--imu", "good"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("factory-calibrated"));
}

TEST_F(Commands, CreatesARigFromAFileWithOverrides) {
  const std::string file = WriteFile(ToJson(ToProto(ARig("from_file")), false));
  const Outcome outcome = Selfcal({"rig",
                                   "create",
                                   file,
                                   "--id",
                                   "device",
                                   "--pixel-sigma",
                                   "0.8",
                                   "--gyro-bias-walk",
                                   "5e-5",
                                   "--accel-bias-walk",
                                   "2e-3",
                                   "--fixed",
                                   "imu.gyro.*",
                                   "--fixed",
                                   "*.focal.x",
                                   "--estimate-time-offset"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(daemon_.rigs.size(), 1u);
  v1::Rig expected = ToProto(ARig("device"));
  expected.set_pixel_sigma_px(0.8);
  expected.mutable_imu_noise()->set_gyro_bias_random_walk(5e-5);
  expected.mutable_imu_noise()->set_accel_bias_random_walk(2e-3);
  expected.add_fixed("imu.gyro.*");
  expected.add_fixed("*.focal.x");
  expected.set_estimate_time_offset(true);
  EXPECT_EQ(daemon_.rigs[0].SerializeAsString(), expected.SerializeAsString());
  EXPECT_THAT(outcome.out, HasSubstr("rig\tdevice\n"));
  EXPECT_THAT(outcome.out, HasSubstr("cam0.focal.x\t255\tpx\n"));
  EXPECT_THAT(outcome.out, HasSubstr("cam0.time_offset\t0\ts\n"));
  EXPECT_THAT(outcome.out, HasSubstr("time offset\testimated\n"));
}

TEST_F(Commands, NamesTheFieldOfAFileThatItCannotRead) {
  const Outcome unknown =
      Selfcal({"rig", "create", WriteFile(R"({"factroy": {}})")});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("factroy"));
  EXPECT_THAT(unknown.err, HasSubstr("rig.json"));
  EXPECT_EQ(Selfcal({"rig", "create", WriteFile("{")}).code, 2);
  EXPECT_TRUE(daemon_.rigs.empty());
}

TEST_F(Commands, PrintsEveryViolatedFieldOfARefusal) {
  daemon_.refusal = BadField("rig.pixel_sigma_px", "is -1; must be positive");
  const Outcome outcome = Selfcal({"rig", "create", WriteFile("{}")});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err,
              HasSubstr("\n  rig.pixel_sigma_px: is -1; must be positive\n"));
}

TEST_F(Commands, ListsEveryPage) {
  for (const char* id : {"a", "b", "c", "d", "e"}) {
    daemon_.rigs.push_back(ToProto(ARig(id)));
  }
  const Outcome lines = Selfcal({"rig", "list"});
  EXPECT_EQ(lines.code, 0);
  EXPECT_EQ(std::count(lines.out.begin(), lines.out.end(), '\n'), 5);
  EXPECT_EQ(lines.out.substr(0, 2), "a\t");
  const auto message =
      Parse<v1::ListRigsResponse>(Selfcal({"rig", "list", "--json"}).out);
  ASSERT_EQ(message.rigs_size(), 5);
  EXPECT_EQ(message.rigs(4).name(), "rigs/e");
  EXPECT_EQ(message.next_page_token(), "");
}

TEST_F(Commands, JsonIsTheMessageOfTheContract) {
  daemon_.rigs.push_back(ToProto(ARig("device")));
  const Outcome outcome = Selfcal({"--json", "rig", "show", "device"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("\"pixel_sigma_px\": 1"));
  EXPECT_EQ(Parse<v1::Rig>(outcome.out).SerializeAsString(),
            daemon_.rigs[0].SerializeAsString());
}

TEST_F(Commands, RigShowHasThePriorMeanBesideTheFactoryValues) {
  Rig rig = ARig("device");
  daemon_.rigs.push_back(ToProto(rig));
  EXPECT_THAT(Selfcal({"rig", "show", "device"}).out,
              Not(HasSubstr("px\t258")));
  rig.prior_mean = rig.factory;
  rig.prior_mean->cameras[0].f.x() = 258;
  daemon_.rigs[0] = ToProto(rig);
  const Outcome outcome = Selfcal({"rig", "show", "device"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("cam0.focal.x\t255"), HasSubstr("px\t258")));
}

TEST_F(Commands, ARefusalExitsWithOne) {
  const Outcome outcome = Selfcal({"rig", "show", "nobody"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.err, "selfcal: rigs/nobody does not exist\n");
}

v1::Segment ScoredSegment(int index) {
  v1::Segment segment;
  segment.set_name("rigs/device/segments/walk~" + std::to_string(index));
  segment.set_state(v1::Segment::SCORED);
  segment.set_end_ns(3'900'000'000);
  segment.set_keyframes(40);
  if (index > 0) {
    segment.set_temperature_c(21.25 * index);
    segment.mutable_motion()->set_angular_rate(0.5 * index);
    segment.mutable_motion()->set_acceleration(1.25 * index);
  }
  for (const char* group : {"imu", "camera"}) {
    v1::GroupScore* score = segment.add_scores();
    score->set_group(group);
    score->set_entropy_nats(-12.345);
    score->set_in_table(std::string(group) == "imu");
  }
  auto* part = segment.add_unobserved()->add_parts();
  part->set_component("imu.gyro.scale.x");
  part->set_weight(1);
  return segment;
}

TEST_F(Commands, ListsSegmentsWithTheirEntropies) {
  for (int i = 2; i >= 0; --i) daemon_.segments.push_back(ScoredSegment(i));
  daemon_.segments[0].clear_scores();
  daemon_.segments[0].set_state(v1::Segment::STORED);
  const Outcome outcome = Selfcal({"segments", "list", "device"});
  EXPECT_EQ(daemon_.last_name, "rigs/device");
  EXPECT_EQ(outcome.out,
            "walk~2\tstored\t-\t40\t3.90\t0\t0\t-\t-\t-\t42.5"
            "\t1.00\t2.50\n"
            "walk~1\tscored\t-\t40\t3.90\t0\t0\t-12.35\t-12.35\timu\t21.2"
            "\t0.50\t1.25\n"
            "walk~0\tscored\t-\t40\t3.90\t0\t0\t-12.35\t-12.35\timu\t-\t-"
            "\t-\n");
}

TEST_F(Commands, AsksForSegmentsByFilterAndOrder) {
  const Outcome outcome = Selfcal({"segments",
                                   "list",
                                   "device",
                                   "--filter",
                                   "state = SCORED",
                                   "--order-by",
                                   "gain.imu asc"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "state = SCORED");
  EXPECT_EQ(daemon_.last_order, "gain.imu asc");
}

TEST_F(Commands, ShowsASegmentAndWhatItDoesNotObserve) {
  daemon_.segments.push_back(ScoredSegment(0));
  const Outcome outcome = Selfcal({"segments", "show", "device", "walk~0"});
  EXPECT_EQ(daemon_.last_name, "rigs/device/segments/walk~0");
  EXPECT_THAT(outcome.out, HasSubstr("not observed\timu.gyro.scale.x"));
  EXPECT_THAT(outcome.out, HasSubstr("imu\t-12.345\t"));
  const Outcome json =
      Selfcal({"segments", "show", "device", "walk~0", "--json"});
  EXPECT_EQ(Parse<v1::Segment>(json.out).SerializeAsString(),
            daemon_.segments[0].SerializeAsString());
}

TEST_F(Commands, PrintsTheEntriesOfTheTables) {
  v1::Table* table = daemon_.tables.add_tables();
  table->set_name("rigs/device/tables/imu");
  for (int i = 0; i < 2; ++i) {
    auto* entry = table->add_entries();
    entry->set_segment("rigs/device/segments/walk~" + std::to_string(i));
    entry->set_entropy_nats(-10 + i);
    entry->set_gain_nats(5 - i);
  }
  const Outcome outcome = Selfcal({"tables", "device"});
  EXPECT_EQ(outcome.out,
            "imu\t1\twalk~0\t-10.000000\t5.000000\n"
            "imu\t2\twalk~1\t-9.000000\t4.000000\n");
}

TEST_F(Commands, ShowsACalibrationWithItsOriginAndValues) {
  daemon_.calibrations = {Version(1), Version(2)};
  const Outcome outcome = Selfcal({"calibrations", "show", "device"});
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/active");
  EXPECT_THAT(outcome.out, HasSubstr("version\t2\n"));
  EXPECT_THAT(outcome.out, HasSubstr("started from\tversion 1\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("temperature\t21.5 C, 20.0 to 23.0 C (1 of 1 "
                        "segment)\n"));
  EXPECT_THAT(outcome.out, HasSubstr("held constant\tcam0.p_CI.z"));
  EXPECT_THAT(outcome.out,
              HasSubstr("noise\tpixel sigma: residuals suggest 1.23 times what "
                        "the rig states (+- 2 %)\n"));
  EXPECT_THAT(
      outcome.out,
      HasSubstr("noise\tgyro bias walk: residuals do not determine it\n"));
  EXPECT_THAT(outcome.out, HasSubstr("noise\tsecond accel noise: residuals"));
  EXPECT_THAT(outcome.out, HasSubstr("cam0.focal.x\t255.123\tpx\t0.034\n"));
  Selfcal({"calibrations", "show", "device", "7"});
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/7");
}

TEST_F(Commands, ShowsTheStoredVerdictWithEachVersion) {
  daemon_.calibrations = {Version(1), Version(2)};
  v1::Verdict* verdict = daemon_.calibrations[1].mutable_verdict();
  verdict->set_kind(v1::Verdict::WEAK);
  verdict->set_text("weak");
  verdict->add_sentences("Hardly learned: cam0.p_CI.z.");
  const Outcome shown = Selfcal({"calibrations", "show", "device"});
  EXPECT_THAT(shown.out, HasSubstr("verdict\tweak\n"));
  EXPECT_THAT(shown.out,
              HasSubstr("weak because\tHardly learned: cam0.p_CI.z.\n"));
  const Outcome listed = Selfcal({"calibrations", "list", "device"});
  EXPECT_THAT(listed.out, HasSubstr("\tweak\t"));
  EXPECT_THAT(listed.out, HasSubstr("\tunknown\t")) << "an older daemon's";
}

TEST_F(Commands, ListsAVersionOfOneSegmentInTheSingular) {
  daemon_.calibrations = {Version(2)};
  daemon_.calibrations[0].mutable_solver()->set_segments(1);
  EXPECT_THAT(Selfcal({"calibration", "list", "device"}).out,
              HasSubstr("\tconverged, 1 segment, rms "));
}

TEST_F(Commands, ShowsRotationsInDegreesFromTheFactorys) {
  daemon_.calibrations = {Version(1)};
  auto* rotation = daemon_.calibrations[0].add_estimates();
  rotation->set_component("cam0.q_CI.x");
  rotation->set_unit("rad");
  rotation->set_value(-3.14);
  rotation->set_from_factory(0.01);
  rotation->set_sigma(0.001);
  const Outcome outcome = Selfcal({"calibrations", "show", "device"});
  EXPECT_THAT(outcome.out,
              HasSubstr("cam0.q_CI.x\t0.573\tdeg from factory\t0.057\n"));
}

TEST_F(Commands, ActivateSaysWhichAndWhy) {
  daemon_.calibrations = {Version(1)};
  const Outcome outcome = Selfcal(
      {"calibrations", "activate", "device", "1", "--reason", "it drifts"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/1");
  EXPECT_EQ(daemon_.last_reason, "it drifts");
  EXPECT_NE(Selfcal({"calibrations", "activate", "device", "1"}).code, 0);
}

TEST_F(Commands, DiffShowsDifferencesWithTheirSigmas) {
  daemon_.differences.set_significant(true);
  daemon_.differences.set_degrees(26);
  auto* one = daemon_.differences.add_differences();
  one->set_component("cam0.focal.x");
  one->set_difference(1.5);
  one->set_sigma(0.25);
  const Outcome outcome = Selfcal({"calibrations", "diff", "device", "1"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_name,
            "rigs/device/calibrations/1 rigs/device/calibrations/active");
  EXPECT_THAT(outcome.out, HasSubstr("cam0.focal.x"));
  EXPECT_THAT(outcome.out, HasSubstr("1.50"));
  EXPECT_THAT(outcome.out, HasSubstr("significant"));
}

TEST_F(Commands, WatchPrintsALineForEachVersion) {
  daemon_.calibrations = {Version(1), Version(2), Version(3)};
  const Outcome some =
      Selfcal({"calibrations", "watch", "device", "--count", "2"});
  EXPECT_EQ(some.code, 0);
  EXPECT_EQ(std::count(some.out.begin(), some.out.end(), '\n'), 2);
  EXPECT_EQ(some.out.substr(0, 9), "1\tactive\t");

  const Outcome all = Selfcal({"calibrations", "watch", "device", "--json"});
  EXPECT_EQ(all.code, 3) << "the daemon went away";
  std::istringstream lines(all.out);
  std::string line;
  for (std::int64_t version = 1; version <= 3; ++version) {
    ASSERT_TRUE(std::getline(lines, line));
    EXPECT_EQ(Parse<v1::Calibration>(line).version(), version);
  }
}

}  // namespace
}  // namespace selfcal::client
