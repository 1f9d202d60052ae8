// Sessions, exclusions and residuals over HTTP.
#include "core/information/segment_residuals.h"
#include "server/console/transcoding.h"
#include "test/server/console/console_test.h"
#include "test/server/store/fake_information.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class MotionTest : public ConsoleTest {
 protected:
  // Segments of one session with data.
  std::vector<MotionSegment> AddSegments(const Rig& rig,
                                         int count,
                                         const std::string& session = "s") {
    auto segments = TestSegments(rig, count, session);
    for (const MotionSegment& segment : segments) {
      EXPECT_TRUE(domain_->PutSegment(rig.id, segment).ok());
    }
    return segments;
  }

  void Score(const Rig& rig, int index, double entropy, double gain = 5) {
    ASSERT_TRUE(domain_
                    ->CommitScore(rig.id,
                                  {"s", index},
                                  FakeInformation(rig, entropy, gain))
                    .ok());
  }

  // As if the caller had these grants alone.
  HttpResponse GetAs(const std::vector<Grant>& grants,
                     const std::string& path) {
    HttpRequest request;
    request.method = "GET";
    request.path = path;
    request.caller = {"somebody", grants};
    return Transcoding(&*api_).Answer(request);
  }
};

TEST_F(MotionTest, SessionsAreListedByName) {
  const Rig rig = AddRig("r");
  AddSegments(rig, 2, "walk");
  AddSegments(rig, 1, "a b/c");
  const auto first = Get("/api/v1/rigs/r/sessions?page_size=1").json();
  ASSERT_EQ(first["sessions"].size(), 1u);
  EXPECT_EQ(first["sessions"][0]["name"], "rigs/r/sessions/a%20b%2Fc");
  EXPECT_EQ(first["sessions"][0]["session"], "a b/c");
  const std::string token = first["nextPageToken"];
  const auto second =
      Get("/api/v1/rigs/r/sessions?page_size=1&page_token=" + token).json();
  EXPECT_EQ(second["sessions"][0]["session"], "walk");
  EXPECT_EQ(second["sessions"][0]["segments"], "2");
  EXPECT_EQ(second["nextPageToken"], "");
  // Its own page has it.
  const Reply own = Get("/api/v1/rigs/r/sessions/a%2520b%252Fc/trajectory");
  EXPECT_EQ(own.status, 200) << own.body;
  EXPECT_EQ(own.json()["session"]["segments"], "1");
}

TEST_F(MotionTest, ATrajectoryHasEverySegmentAlsoThoseWithoutData) {
  const Rig rig = AddRig("r");
  const auto segments = AddSegments(rig, 3);
  Score(rig, 0, -9);
  Score(rig, 1, -8, 0);  // gains too little: its data goes with the reserve
  for (MotionSegment& segment : AddSegments(rig, kReserve, "later")) {
    ASSERT_TRUE(
        domain_->CommitScore(rig.id, segment.key, FakeInformation(rig, -8, 0))
            .ok());
  }
  const auto trajectory =
      Get("/api/v1/rigs/r/sessions/s/trajectory?page_size=2").json();
  ASSERT_EQ(trajectory["segments"].size(), 2u);
  EXPECT_EQ(trajectory["session"]["segments"], "3");
  const auto& kept = trajectory["segments"][0];
  EXPECT_EQ(kept["segment"], "rigs/r/segments/s~0");
  EXPECT_EQ(kept["tables"].size(), rig.groups.size());
  EXPECT_EQ(kept["scores"][0]["entropyNats"], -9);
  EXPECT_EQ(kept["hasData"], true);
  const auto& dropped = trajectory["segments"][1];
  EXPECT_EQ(dropped["hasData"], false);
  EXPECT_EQ(dropped["tables"].size(), 0u);
  ASSERT_EQ(dropped["positionsM"].size(), 3 * segments[1].keyframes.size());
  const Eigen::Vector3d& p = segments[1].keyframes.back().p_GI;
  EXPECT_NEAR(dropped["positionsM"].back().get<double>(), p.z(), 1e-5);
  const std::string token = trajectory["nextPageToken"];
  const auto rest =
      Get("/api/v1/rigs/r/sessions/s/trajectory?page_token=" + token).json();
  ASSERT_EQ(rest["segments"].size(), 1u);
  EXPECT_EQ(rest["segments"][0]["scored"], false);
  EXPECT_EQ(rest["nextPageToken"], "");
}

TEST_F(MotionTest, AnEvictedSegmentSaysWhatCameInstead) {
  const Rig rig = AddRig("r");  // tables of 2
  AddSegments(rig, 3);
  Score(rig, 0, -1);
  Score(rig, 1, -3);
  Score(rig, 2, -2);
  const auto exclusions =
      Get("/api/v1/rigs/r/segments/s~0").json()["exclusions"];
  ASSERT_EQ(exclusions.size(), rig.groups.size());
  EXPECT_EQ(exclusions[0]["group"], rig.groups[0].name);
  EXPECT_EQ(exclusions[0]["cause"], "REPLACED");
  EXPECT_EQ(exclusions[0]["rival"], "rigs/r/segments/s~2");
  EXPECT_EQ(exclusions[0]["rivalEntropyNats"], -2);
  EXPECT_EQ(Get("/api/v1/rigs/r/segments/s~2").json()["exclusions"].size(), 0u);
}

TEST_F(MotionTest, InformationIsTheSigmaOfEachComponentBeforeAndAfter) {
  const Rig rig = AddRig("r");
  AddSegments(rig, 2);
  const std::string path = "/api/v1/rigs/r/segments/s~0/information";
  EXPECT_TRUE(Get(path).json()["components"].empty()) << "no score";
  // Says of the first component three times what the prior does.
  const Eigen::VectorXd prior = PriorSigmas(rig);
  SegmentInformation information = FakeInformation(rig, 1);
  information.Lambda.setZero();
  information.eta.setZero();
  information.Lambda(0, 0) = 3 / (prior(0) * prior(0));
  ASSERT_TRUE(domain_->CommitScore("r", {"s", 0}, information).ok());
  const auto components = Get(path).json()["components"];
  ASSERT_EQ(components.size(), FreeComponents(rig).size());
  for (std::size_t k = 0; k < components.size(); ++k) {
    const int i = FreeComponents(rig)[k];
    EXPECT_EQ(components[k]["component"],
              TangentComponents(rig.factory)[i].name);
    EXPECT_EQ(components[k]["priorSigma"].get<double>(), prior(i));
    EXPECT_NEAR(components[k]["sigma"].get<double>() / prior(i),
                i == 0 ? 0.5 : 1,
                1e-9);
  }
}

TEST_F(MotionTest, ResidualsAreThoseOfTheCoreAtTheVersionThatIsAskedFor) {
  const Rig rig = AddRig("r");
  AddVersion(rig);  // version 2 has the values of version 1
  const MotionSegment segment = TestSegments(rig, 1, "other")[0];
  ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
  const SegmentResiduals expected =
      EvaluateResiduals(rig, rig.factory, segment);
  const std::string path = "/api/v1/rigs/r/segments/other~0/residuals";
  const auto residuals = Get(path).json();
  EXPECT_EQ(residuals["calibrationVersion"], "1");
  ASSERT_EQ(residuals["residualPx"].size(), 2 * segment.observations.size());
  for (std::size_t i = 0; i < segment.observations.size(); ++i) {
    const Eigen::Vector2d& px = expected.observations[i].residual_px;
    EXPECT_NEAR(residuals["residualPx"][2 * i].get<double>(), px.x(), 1e-4);
    EXPECT_NEAR(residuals["residualPx"][2 * i + 1].get<double>(), px.y(), 1e-4);
  }
  EXPECT_EQ(residuals["unused"].size(),
            segment.observations.size() - expected.statistics.inliers);
  ASSERT_EQ(residuals["cameras"].size(), 1u);
  EXPECT_EQ(residuals["cameras"][0]["inliers"], expected.statistics.inliers);
  EXPECT_NEAR(residuals["cameras"][0]["inlierRmsPx"].get<double>(),
              expected.statistics.reprojection_rms_px,
              1e-6);
  const auto& whitened = residuals["intervals"]["whitened"];
  ASSERT_EQ(whitened.size(), 15 * (segment.keyframes.size() - 1));
  EXPECT_NEAR(
      whitened[3].get<double>(), expected.intervals[0].whitened[3], 1e-9);
  EXPECT_EQ(Get(path + "?calibration_version=2").json()["calibrationVersion"],
            "2");
}

TEST_F(MotionTest, MistakesSayWhatToDo) {
  const Rig rig = AddRig("r");
  AddSegments(rig, 1);
  const std::pair<const char*, int> kMistakes[] = {
      {"rigs/none/sessions", 404},
      {"rigs/r/sessions/none/trajectory", 404},
      {"rigs/r/sessions/a%25/trajectory", 400},
      {"rigs/r/sessions/s/trajectory?page_token=x", 400},
      {"rigs/r/segments/s~9/information", 404},
      {"rigs/r/segments/s~0/residuals?calibration_version=7", 404},
      {"rigs/r/segments/s~0/residuals?calibration_version=x", 400},
      {"rigs/r/segments/s~0/residuals?calibration_version=-1", 400},
      {"rigs/r/segments/s~9/residuals", 404},
  };
  for (const auto& [path, status] : kMistakes) {
    const Reply reply = Get(std::string("/api/v1/") + path);
    EXPECT_EQ(reply.status, status) << path << ": " << reply.body;
    EXPECT_NE(reply.json().value("whatToDo", ""), "") << path;
  }
  ASSERT_TRUE(domain_->MarkUnusable("r", {"s", 0}, "test").ok());
  const Reply gone = Get("/api/v1/rigs/r/segments/s~0/residuals");
  EXPECT_EQ(gone.status, 409);
  EXPECT_THAT(gone.body, HasSubstr("was dropped"));
}

// Whoever may read the rig, and nobody else.
TEST_F(MotionTest, EachCallNeedsTheRoleOnItsRig) {
  const Rig rig = AddRig("r");
  AddRig("other");
  AddSegments(rig, 1);
  for (const char* path : {"/api/v1/rigs/r/sessions",
                           "/api/v1/rigs/r/sessions/s/trajectory",
                           "/api/v1/rigs/r/segments/s~0/information",
                           "/api/v1/rigs/r/segments/s~0/residuals"}) {
    EXPECT_EQ(GetAs({{Role::kRead, "r"}}, path).status, 200) << path;
    EXPECT_EQ(GetAs({{Role::kRead, ""}}, path).status, 200) << path;
    for (const auto& grants :
         std::vector<std::vector<Grant>>{{}, {{Role::kAdminister, "other"}}}) {
      const HttpResponse refused = GetAs(grants, path);
      EXPECT_EQ(refused.status, 403) << path;
      EXPECT_THAT(refused.body, HasSubstr("PERMISSION_DENIED"));
    }
  }
}

}  // namespace
}  // namespace selfcal::server
