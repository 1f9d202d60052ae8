// A vigorous session that diverged comes before a calm, good one: the tables
// end with segments of the good one alone. Real scores of simulated segments.
#include <map>
#include <random>

#include "core/information/segment_information.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class MisfitTest : public PipelineTest {
 protected:
  MisfitTest() {
    rig_ = TestRig("a");
    rig_.table_size = 4;
    EXPECT_TRUE(domain_->CreateRig(rig_).ok());
    // With the fit of the reprojections alone, measured here: nothing of this
    // depends on how a score comes to its own.
    estimators_.score = [](const Rig& rig,
                           const Calibration& theta0,
                           const MotionSegment& segment) {
      SegmentInformation information = ScoreSegment(rig, theta0, segment);
      information.residuals.fit =
          information.residuals.reprojection_rms_px / rig.pixel_sigma_px;
      return information;
    };
  }
  ~MisfitTest() override { pipeline_.reset(); }

  std::vector<MotionSegment> Session(const std::string& session,
                                     int count,
                                     double vigour,
                                     int landmarks) const {
    SimulationOptions options;
    options.imu_rate_hz = 100;
    options.keyframes_per_segment = 8;
    options.landmarks_in_view = landmarks;
    const double segment_s =
        options.keyframes_per_segment / options.keyframe_rate_hz;
    const auto trajectory = MakeHandheld((count + 1) * segment_s, vigour, 1);
    auto segments =
        Simulate(
            rig_, rig_.factory, rig_.factory, *trajectory, session, options)
            .segments;
    segments.resize(static_cast<std::size_t>(count));
    return segments;
  }

  // Pixels of a tracker that has lost its way.
  void Diverge(MotionSegment* segment) {
    const CameraCalibration& camera = rig_.factory.cameras[0];
    const Eigen::Vector2d corner(camera.width_px - 1.0, camera.height_px - 1.0);
    std::normal_distribution<double> normal(0, 8 * rig_.pixel_sigma_px);
    for (Observation& seen : segment->observations) {
      seen.z_px += Eigen::Vector2d(normal(random_), normal(random_));
      seen.z_px = seen.z_px.cwiseMax(0.0).cwiseMin(corner);
    }
  }

  void Send(const std::vector<MotionSegment>& segments) {
    for (const MotionSegment& segment : segments) {
      const auto sent = pipeline_->Submit("a", segment, [] { return false; });
      ASSERT_TRUE(sent.ok()) << sent.status();
      ASSERT_EQ(sent->verdict, SubmitResult::Verdict::kStored);
    }
    ASSERT_TRUE(AllScored());
  }

  // Entries of the tables by session.
  std::map<std::string, int> Held() {
    std::map<std::string, int> held;
    const auto tables = store_->GetTables("a");
    EXPECT_TRUE(tables.ok());
    for (const Table& table : *tables) {
      for (const TableEntry& entry : table.entries) ++held[entry.key.session];
    }
    return held;
  }

  Rig rig_;
  std::mt19937_64 random_{3};
};

TEST_F(MisfitTest, GoodSegmentsAfterADivergedSessionTakeItsPlaces) {
  std::vector<MotionSegment> diverged = Session("diverged", 12, 2, 90);
  for (MotionSegment& segment : diverged) Diverge(&segment);
  StartOne();
  Send(diverged);
  const int places = 4 * static_cast<int>(rig_.groups.size());
  ASSERT_EQ(Held()["diverged"], places);
  const auto good = Session("good", 24, 0.5, 30);
  Send(good);
  const auto held = Held();
  EXPECT_FALSE(held.contains("diverged"));
  EXPECT_GE(held.at("good"), places / 2);
  int misfits = 0;
  for (int k = 0; k < 12; ++k) {
    const auto exclusions = store_->ListExclusions("a", {"diverged", k});
    ASSERT_TRUE(exclusions.ok()) << exclusions.status();
    for (const Exclusion& exclusion : *exclusions) {
      if (exclusion.cause != ExclusionCause::kDoesNotFit) continue;
      EXPECT_GT(exclusion.fit.value_or(0), exclusion.fit_limit.value_or(1e9));
      ++misfits;
    }
  }
  EXPECT_GT(misfits, 0);
}

// The same sessions where nobody looks at the fit: why it has to be.
TEST_F(MisfitTest, WithoutTheFitADivergedSessionKeepsItsPlaces) {
  estimators_.score = [](const Rig& rig,
                         const Calibration& theta0,
                         const MotionSegment& segment) {
    SegmentInformation information = ScoreSegment(rig, theta0, segment);
    information.residuals.fit = 0;
    return information;
  };
  std::vector<MotionSegment> diverged = Session("diverged", 12, 2, 90);
  for (MotionSegment& segment : diverged) Diverge(&segment);
  StartOne();
  Send(diverged);
  Send(Session("good", 24, 0.5, 30));
  EXPECT_GT(Held()["diverged"], 0);
}

}  // namespace
}  // namespace selfcal::server
