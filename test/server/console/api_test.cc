#include <google/protobuf/util/json_util.h>

#include "proto/resource_names.h"
#include "selfcal/v1/segment.pb.h"
#include "server/encode/encode.h"
#include "server/encode/encode_coaching.h"
#include "test/server/console/console_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ApiTest = ConsoleTest;

// The message that the reply holds as JSON.
template <typename Message>
Message Parsed(const Reply& reply) {
  Message message;
  EXPECT_EQ(reply.status, 200) << reply.body;
  EXPECT_THAT(reply.head, HasSubstr("application/json"));
  const auto parsed =
      google::protobuf::util::JsonStringToMessage(reply.body, &message);
  EXPECT_TRUE(parsed.ok()) << parsed.ToString();
  return message;
}

TEST_F(ApiTest, RigsComeInPagesFilteredAndSorted) {
  for (const char* id : {"phone", "tablet-1", "tablet-2"}) AddRig(id);
  const auto first =
      Get("/api/v1/activity?filter=tablet&order_by=name%20desc&page_size=1")
          .json();
  ASSERT_EQ(first["rigs"].size(), 1u);
  EXPECT_EQ(first["rigs"][0]["name"], "rigs/tablet-2");
  EXPECT_EQ(first["rigs"][0]["activeVersion"], "1");
  EXPECT_EQ(first["rigs"][0]["tableCapacity"], 6);
  EXPECT_THAT(first["rigs"][0]["alarms"], IsEmpty());
  const std::string token = first["nextPageToken"];
  const auto second =
      Get("/api/v1/"
          "activity?filter=tablet&order_by=name+desc&page_size=1&page_token=" +
          token)
          .json();
  ASSERT_EQ(second["rigs"].size(), 1u);
  EXPECT_EQ(second["rigs"][0]["name"], "rigs/tablet-1");
  EXPECT_EQ(second["nextPageToken"], "");
}

TEST_F(ApiTest, ValuesAreThoseOfTheContract) {
  const Rig rig = AddRig("r");
  AddVersion(rig);
  EXPECT_EQ(Parsed<v1::Rig>(Get("/api/v1/rigs/r")).SerializeAsString(),
            Encode(*store_->GetRig("r")).SerializeAsString());
  const auto active = *store_->GetActiveCalibration("r");
  for (const char* path : {"active", "2"}) {
    EXPECT_EQ(Parsed<v1::Calibration>(
                  Get("/api/v1/rigs/r/calibrations/" + std::string(path)))
                  .SerializeAsString(),
              Encode(active, *store_->GetRig("r")).SerializeAsString());
  }
  v1::Segment segment = Encode(*store_->GetSegment("r", {"s", 0}));
  EXPECT_EQ(Parsed<v1::Segment>(Get("/api/v1/rigs/r/segments/s~0"))
                .SerializeAsString(),
            segment.SerializeAsString());
  // A list leaves out the directions.
  ASSERT_EQ(segment.unobserved_size(), 1);
  ASSERT_EQ(segment.scores(0).unobserved_size(), 1);
  segment.clear_unobserved();
  for (v1::GroupScore& score : *segment.mutable_scores()) {
    score.clear_unobserved();
  }
  const auto segments = Parsed<v1::ListSegmentsResponse>(
      Get("/api/v1/rigs/r/segments?view=BASIC"));
  ASSERT_EQ(segments.segments_size(), 1);
  EXPECT_EQ(segments.segments(0).SerializeAsString(),
            segment.SerializeAsString());
  EXPECT_EQ(Get("/api/v1/rigs/r/tables").json()["tables"].size(),
            rig.groups.size());
  EXPECT_EQ(Get("/api/v1/rigs/r/calibrations").json()["calibrations"].size(),
            2u);
  EXPECT_EQ(Get("/api/v1/rigs/r/recalibrations")
                .json()["recalibrations"][0]["calibration"],
            "rigs/r/calibrations/2");
  EXPECT_EQ(Get("/api/v1/rigs/r/recalibrations/1").json()["state"],
            "SUCCEEDED");
}

TEST_F(ApiTest, DataOfASegmentIsReadWhileItIsKept) {
  const Rig rig = AddRig("r");
  MotionSegment segment = TestSegments(rig, 1)[0];
  segment.key.session = "a b/c";
  ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
  // The name of the segment has "a%20b%2Fc", and '%' is %25 in an address.
  const std::string path = "/api/v1/rigs/r/segments/a%2520b%252Fc~0";
  const auto data = Parsed<v1::MotionSegment>(Get(path + "/data"));
  EXPECT_EQ(data.session(), "a b/c");
  EXPECT_EQ(data.keyframes().t_ns_size(),
            static_cast<int>(segment.keyframes.size()));
  ASSERT_TRUE(domain_->MarkUnusable("r", segment.key, "test").ok());
  EXPECT_EQ(Get(path).json()["hasData"], false);
  EXPECT_EQ(Get(path + "/data").status, 409);
}

TEST_F(ApiTest, SegmentsAreFilteredAndSorted) {
  const Rig rig = AddRig("r");
  for (const char* session : {"a", "b"}) {
    for (const MotionSegment& segment : TestSegments(rig, 2, session)) {
      ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
    }
  }
  const std::string path = "/api/v1/rigs/r/segments";
  const auto listed =
      Get(path + "?filter=session%3Db&order_by=receive_time%20asc")
          .json()["segments"];
  ASSERT_EQ(listed.size(), 2u);
  EXPECT_EQ(listed[0]["name"], "rigs/r/segments/b~0");
  EXPECT_EQ(listed[1]["name"], "rigs/r/segments/b~1");
  const auto wrong = Get(path + "?filter=colour%3D1");
  EXPECT_EQ(wrong.status, 400);
  EXPECT_THAT(wrong.body, HasSubstr("colour"));
  EXPECT_EQ(Get(path + "?order_by=colour").status, 400);
}

TEST_F(ApiTest, TwoVersionsAreCompared) {
  AddVersion(AddRig("r"));
  const auto compared = Get("/api/v1/rigs/r/calibrations/1:compare"
                            "?b=rigs/r/calibrations/active")
                            .json();
  EXPECT_EQ(compared["versionA"], "1");
  EXPECT_EQ(compared["versionB"], "2");
  EXPECT_EQ(compared["significant"], false);
  EXPECT_EQ(Get("/api/v1/rigs/r/calibrations/1:compare").status, 400);
}

TEST_F(ApiTest, TheCoachSaysWhatThePipelineSays) {
  AddRig("r");
  const auto expected = pipeline_->AdviseMotion("r");
  ASSERT_TRUE(expected.ok()) << expected.status();
  const auto told =
      Parsed<v1::AdviseMotionResponse>(Get("/api/v1/rigs/r:adviseMotion"));
  EXPECT_EQ(told.SerializeAsString(), Encode(*expected, 3).SerializeAsString());
  EXPECT_EQ(told.advice_size(), 3);
  EXPECT_EQ(
      Get("/api/v1/rigs/r:adviseMotion?max_advice=1").json()["advice"].size(),
      1u);
}

TEST_F(ApiTest, EventsComeInTheOrderThatIsAskedFor) {
  AddRig("a");
  AddRig("b");
  const auto all =
      Get("/api/v1/events?order_by=number%20desc").json()["events"];
  ASSERT_GE(all.size(), 2u);
  EXPECT_EQ(all[0]["rig"], "rigs/b");
  EXPECT_EQ(all.back()["kind"], "RIG_CREATED");
  EXPECT_EQ(Get("/api/v1/events").json()["events"][0], all.back());
  const auto of_one = Get("/api/v1/rigs/a/events").json()["events"];
  ASSERT_FALSE(of_one.empty());
  for (const auto& event : of_one) EXPECT_EQ(event["rig"], "rigs/a");
}

TEST_F(ApiTest, MistakesSayWhatToDo) {
  AddRig("r");
  const std::pair<const char*, int> kMistakes[] = {
      {"/api/v1/rigs/none", 404},
      {"/api/v1/rigs/NO", 400},
      {"/api/v1/rigs/none/tables", 404},
      {"/api/v1/rigs/none/events", 404},
      {"/api/v1/rigs/r/segments/x", 400},
      {"/api/v1/rigs/r/segments/x~1", 404},
      {"/api/v1/rigs/r/calibrations/0", 400},
      {"/api/v1/rigs/r/calibrations/7", 404},
      {"/api/v1/rigs/r/recalibrations/1", 404},
      {"/api/v1/rigs?page_size=many", 400},
      {"/api/v1/rigs?page_token=zz", 400},
      {"/api/v1/rigs?colour=red", 400},
      {"/api/v1/activity?order_by=colour", 400},
      {"/api/v1/rigs/none:adviseMotion", 404},
      {"/api/v1/rigs/r:adviseMotion?max_advice=all", 400},
      {"/api/v1/rigs/r/recalibrations/x:watch", 400},
      {"/api/v1/rigs/r/recalibrations/1:watch", 404},
      {"/api/v1/rigs/none/changes:watch", 404},
      {"/api/v1/rigs/none/calibrations:watch", 404},
      {"/api/v1/nothing", 404},
      {"/api/v2/rigs", 404},
  };
  for (const auto& [path, status] : kMistakes) {
    const Reply reply = Get(path);
    EXPECT_EQ(reply.status, status) << path << " " << reply.body;
    EXPECT_FALSE(reply.json().value("code", "").empty()) << path;
    EXPECT_FALSE(reply.json().value("message", "").empty()) << path;
    EXPECT_FALSE(reply.json().value("whatToDo", "").empty()) << path;
  }
}

TEST_F(ApiTest, PagesHaveAddressesThatCanBeShared) {
  const Reply front = Get("/");
  EXPECT_EQ(front.status, 200);
  EXPECT_THAT(front.head, HasSubstr("text/html"));
  EXPECT_EQ(Get("/rigs/r/calibrations?a=1&b=2").body, front.body);
  EXPECT_THAT(Get("/assets/app.js").head, HasSubstr("text/javascript"));
  EXPECT_THAT(Get("/assets/app.css").head, HasSubstr("text/css"));
  EXPECT_EQ(Get("/assets/other.js").status, 404);
  // Nothing from elsewhere.
  EXPECT_EQ(front.body.find("http"), std::string::npos);
}

}  // namespace
}  // namespace selfcal::server
