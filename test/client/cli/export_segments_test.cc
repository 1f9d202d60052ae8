// selfcal segment export.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class SegmentExport : public Commands {
 protected:
  SegmentExport() {
    for (int k = 0; k < 3; ++k) {
      v1::Segment listed;
      listed.set_name("rigs/device/segments/a,b~" + std::to_string(k));
      daemon_.segments.push_back(listed);
      v1::MotionSegment data;
      data.set_session("a,b");
      data.set_index(k);
      data.mutable_keyframes()->add_t_ns(1'000'000'007);
      for (const double q : {0.1, 0.2, 0.3, 1.0 / 3}) {
        data.mutable_keyframes()->add_q_gi(q);
      }
      for (int i = 0; i < 3; ++i) {
        data.mutable_keyframes()->add_p_gi(i);
        data.mutable_keyframes()->add_v_gi(i);
        data.mutable_keyframes()->add_b_a(0);
        data.mutable_keyframes()->add_b_g(0);
        data.mutable_imu()->add_gyro(0.5 * i);
        data.mutable_imu()->add_accel(9.81);
        data.mutable_landmarks()->add_p_g(-1e-9);
      }
      data.mutable_imu()->add_t_ns(5);
      data.mutable_landmarks()->add_id(18'446'744'073'709'551'615u);
      data.mutable_observations()->add_keyframe(0);
      data.mutable_observations()->add_camera(0);
      data.mutable_observations()->add_landmark(0);
      data.mutable_observations()->add_z_px(320.25);
      data.mutable_observations()->add_z_px(240);
      daemon_.data.push_back(data);
    }
  }

  std::string Read(const std::string& name) const {
    return ReadBytes(folder_ + name);
  }

  const std::string folder_ = temp_folder_.File("exported");
};

TEST_F(SegmentExport, WritesTablesOfAllThatHaveData) {
  const Outcome outcome = Selfcal({"segments",
                                   "export",
                                   "device",
                                   "--output",
                                   folder_,
                                   "--filter",
                                   "gain.imu > 1"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "gain.imu > 1");
  EXPECT_THAT(outcome.out, HasSubstr("segments\t3\n"));
  const std::string keyframes = Read("/keyframes.csv");
  EXPECT_THAT(keyframes, StartsWith("session,index,t_ns,q_GI_w,"));
  EXPECT_THAT(keyframes,
              HasSubstr("\n\"a,b\",2,1000000007,0.1,0.2,0.3,"
                        "0.3333333333333333,0,1,2,0,1,2,0,0,0,0,0,0\n"));
  EXPECT_THAT(Read("/imu.csv"),
              HasSubstr("\n\"a,b\",0,5,0,0.5,1,9.81,9.81,9.81\n"));
  EXPECT_THAT(Read("/landmarks.csv"),
              HasSubstr("\"a,b\",1,18446744073709551615,-1e-09,-1e-09,"
                        "-1e-09\n"));
  EXPECT_THAT(Read("/observations.csv"),
              HasSubstr("\"a,b\",1,0,0,0,320.25,240\n"));
}

TEST_F(SegmentExport, WritesTheMessagesOfSomeALineEach) {
  const Outcome outcome = Selfcal({"segments",
                                   "export",
                                   "device",
                                   "a,b~2",
                                   "a,b~0",
                                   "--format",
                                   "jsonl",
                                   "--output",
                                   folder_});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::istringstream lines(Read(""));
  std::string line;
  for (const int index : {2, 0}) {
    ASSERT_TRUE(std::getline(lines, line));
    EXPECT_EQ(Parse<v1::MotionSegment>(line).SerializeAsString(),
              daemon_.data[index].SerializeAsString());
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(SegmentExport, LeavesOutWhatWasDroppedMeanwhileUnlessItWasNamed) {
  daemon_.data.pop_back();
  const Outcome all =
      Selfcal({"segments", "export", "device", "--output", folder_});
  EXPECT_EQ(all.code, 0) << all.err;
  EXPECT_THAT(all.out, HasSubstr("segments\t2\n"));

  std::filesystem::remove_all(folder_);
  const Outcome one =
      Selfcal({"segments", "export", "device", "a,b~2", "--output", folder_});
  EXPECT_EQ(one.code, 1);
  EXPECT_THAT(one.err, HasSubstr("its data was dropped"));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/imu.csv"));
}

TEST_F(SegmentExport, OverwritesOnlyWhenAsked) {
  ASSERT_EQ(Selfcal({"segments", "export", "device", "--output", folder_}).code,
            0);
  const Outcome again =
      Selfcal({"segments", "export", "device", "--output", folder_});
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("--force"));
  EXPECT_EQ(
      Selfcal({"segments", "export", "device", "--output", folder_, "--force"})
          .code,
      0);
}

}  // namespace
}  // namespace selfcal::client
