#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <utility>

#include "client/cli/motion_advice.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;

v1::AdviseMotionResponse Advice(const std::string& motion, int segments) {
  v1::AdviseMotionResponse response;
  auto* weak = response.add_weakest();
  weak->set_words("the gyroscope's scale on x");
  weak->set_sigma_by_reference(8.5);
  response.set_calibration_version(2);
  response.set_segments_since(segments);
  response.set_segment_seconds(4);
  for (const std::string& name : {motion, std::string("walk")}) {
    auto* advice = response.add_advice();
    advice->set_motion(name);
    advice->set_instruction("Do " + name + ".");
    advice->set_gain_nats(name == "walk" ? 0.251 : 3.14159);
    auto* group = advice->add_group_gains();
    group->set_group("imu");
    group->set_gain_nats(2.5);
    auto* change = advice->add_sigma_changes();
    change->set_component("cam0.focal.x");
    change->set_unit("px");
    change->set_sigma_now(2);
    change->set_sigma_after(1.9);
    change = advice->add_sigma_changes();
    change->set_component("imu.gyro.scale.x");
    change->set_unit("-");
    change->set_sigma_now(0.01);
    change->set_sigma_after(0.002);
  }
  return response;
}

TEST_F(Commands, CoachPrintsOneRecordALine) {
  daemon_.advice = {Advice("pan", 5)};
  const Outcome outcome = Selfcal({"coach", "device"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device");
  EXPECT_EQ(daemon_.max_advice, 3);
  EXPECT_EQ(outcome.out,
            "1\tpan\t3.14\timu 2.50\timu.gyro.scale.x 0.01 -> 0.002\t"
            "Do pan.\n"
            "2\twalk\t0.25\timu 2.50\timu.gyro.scale.x 0.01 -> 0.002\t"
            "Do walk.\n");
}

TEST_F(Commands, CoachAsksForAsManyAsItIsTold) {
  daemon_.advice = {Advice("pan", 5)};
  EXPECT_EQ(Selfcal({"coach", "device", "--top", "7"}).code, kDone);
  EXPECT_EQ(daemon_.max_advice, 7);
  EXPECT_EQ(Selfcal({"coach", "device", "--top", "0"}).code, kUsage);
  EXPECT_EQ(Selfcal({"coach", "device", "--count", "1"}).code, kUsage);
}

TEST_F(Commands, CoachPrintsJson) {
  daemon_.advice = {Advice("pan", 5)};
  const Outcome outcome = Selfcal({"coach", "device", "--json"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  const auto printed = Parse<v1::AdviseMotionResponse>(outcome.out);
  EXPECT_EQ(printed.SerializeAsString(), daemon_.advice[0].SerializeAsString());
}

// The same answer again is not news; another motion or another segment is.
TEST_F(Commands, CoachWatchPrintsALineWhenTheAdviceChanges) {
  daemon_.advice = {
      Advice("pan", 1), Advice("pan", 1), Advice("pan", 6), Advice("nod", 6)};
  const Outcome outcome =
      Selfcal({"coach", "device", "--watch", "--count", "3"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  EXPECT_EQ(outcome.out,
            "pan: Do pan. (+3.14 nat; version 2 and 1 segment since)\n"
            "pan: Do pan. (+3.14 nat; version 2 and 6 segments since)\n"
            "nod: Do nod. (+3.14 nat; version 2 and 6 segments since)\n");
}

TEST_F(Commands, CoachWatchPrintsJsonLines) {
  daemon_.advice = {Advice("pan", 5), Advice("nod", 6)};
  const Outcome outcome =
      Selfcal({"coach", "device", "--watch", "--count", "2", "--json"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 2);
  const auto first = Parse<v1::AdviseMotionResponse>(
      outcome.out.substr(0, outcome.out.find('\n')));
  EXPECT_EQ(first.advice(0).motion(), "pan");
}

TEST(MissingText, SaysWhatToRecordForHowLong) {
  v1::AdviseMotionResponse response = Advice("pan", 5);
  EXPECT_EQ(MissingText(response),
            "no direction is missing; 4 s of this would add most, 3.14 nat: Do "
            "pan.\n");
  for (const auto& [motion, seconds] :
       {std::pair("tumble", 12), std::pair("nod", 4)}) {
    auto* lesson = response.add_lessons();
    lesson->set_motion(motion);
    lesson->set_instruction(std::string("Do ") + motion + ".");
    lesson->set_seconds(seconds);
  }
  EXPECT_EQ(MissingText(response),
            "no direction is missing, but there are too few segments to "
            "confirm a calibration:\n"
            "  record 12 s more of this: Do tumble.\n"
            "  record 4 s more of this: Do nod.\n");
  for (const auto& [words, motion] : {std::pair("a", "tumble"),
                                      std::pair("b", "nod"),
                                      std::pair("c", ""),
                                      std::pair("d", "tumble"),
                                      std::pair("e", "tumble"),
                                      std::pair("f", "tumble"),
                                      std::pair("g", "tumble")}) {
    auto* missing = response.add_missing();
    missing->set_words(words);
    missing->set_motion(motion);
    missing->set_sigma_by_prior(0.93);
    missing->set_sigma_by_prior_after(0.0421);
  }
  EXPECT_EQ(MissingText(response),
            "7 directions are missing; in percent of the uncertainty before "
            "any recording:\n"
            "  record 12 s more of this: Do tumble.\n"
            "    a: 93 % -> 4.2 %\n"
            "    d: 93 % -> 4.2 %\n"
            "    e: 93 % -> 4.2 %\n"
            "    and 2 more\n"
            "  record 4 s more of this: Do nod.\n"
            "    b: 93 % -> 4.2 %\n"
            "  no motion teaches this: hold it fixed, or state it better:\n"
            "    c: 93 %\n");
}

TEST_F(Commands, CoachSaysWhatTheDaemonRefuses) {
  for (const bool watch : {false, true}) {
    std::vector<std::string> arguments = {"coach", "device"};
    if (watch) arguments.push_back("--watch");
    const Outcome outcome = Selfcal(arguments);
    EXPECT_EQ(outcome.code, kFailed);
    EXPECT_THAT(outcome.err, HasSubstr("no such rig"));
  }
}

TEST_F(Commands, CoachWatchSaysThatTheDaemonHasStopped) {
  daemon_.stopping = true;
  const Outcome outcome = Selfcal({"coach", "device", "--watch"});
  EXPECT_EQ(outcome.code, kUnreachable);
  EXPECT_THAT(outcome.err, HasSubstr("Is selfcald running?"));
}

}  // namespace
}  // namespace selfcal::client
