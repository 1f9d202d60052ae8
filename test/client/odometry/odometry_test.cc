// Odometry of a rendered recording against its truth, and on recordings with
// faults.
#include "client/odometry/odometry.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/core.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/tracking/feature_tracker.h"
#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"
#include "core/model/so3.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/rendering/rendered_source.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

constexpr double kSeconds = 10;

Rig RigOfTwoImus() {
  Rig rig = HandheldRig("handheld");
  AddSecondImu(&rig);
  return rig;
}

const RenderedRecording& Rendered() {
  static const auto& rendered = *new RenderedRecording(
      RigOfTwoImus(), MakeHandheld(kSeconds, 1, 5), RenderOptions{});
  return rendered;
}

struct Faults {
  std::set<int> unreadable = {};
  int gap_from = 0;
  int gap_to = 0;
  bool small = false;  // images of another size
};

// The recording, rendered once for all tests.
class Source : public Recording {
 public:
  explicit Source(Faults faults = {})
      : Recording(DataOf(faults)), faults_(std::move(faults)) {}

  absl::StatusOr<GreyPixels> ReadImage(int, int image) override {
    if (image >= faults_.gap_from) image += faults_.gap_to - faults_.gap_from;
    if (faults_.unreadable.contains(image)) {
      return absl::DataLossError("damaged");
    }
    if (faults_.small) return GreyPixels{2, 2, {0, 0, 0, 0}};
    return Images()[static_cast<std::size_t>(image)];
  }

 private:
  static const std::vector<GreyPixels>& Images() {
    static const auto& images = *[] {
      auto* const all = new std::vector<GreyPixels>;
      RenderedSource source(Rendered());
      for (int i = 0; i < Rendered().images(); ++i) {
        all->push_back(*source.ReadImage(0, i));
      }
      return all;
    }();
    return images;
  }

  static RecordedData DataOf(const Faults& faults) {
    RecordedData data;
    data.cameras.resize(1);
    data.cameras[0].name = "cam0";
    for (int i = 0; i < Rendered().images(); ++i) {
      if (faults.gap_from <= i && i < faults.gap_to) continue;
      data.cameras[0].image_times_ns.push_back(Rendered().stamp_ns(i));
    }
    data.imu = Rendered().imu().measured;
    data.imu1 = Rendered().imu1()->measured;
    return data;
  }

  const Faults faults_;
};

std::vector<OdometrySegment> All(Recording* source,
                                 const OdometryOptions& options,
                                 const Rig& rig = HandheldRig("handheld")) {
  Odometry odometry(source, rig, rig.factory, options);
  std::vector<OdometrySegment> segments;
  for (;;) {
    auto next = odometry.Next(rig.factory, 3);
    EXPECT_TRUE(next.ok()) << next.status();
    if (!next.ok() || !*next) return segments;
    segments.push_back(**std::move(next));
  }
}

// Largest distance of the path from the true one, seen from its first keyframe.
double PathError_m(const MotionSegment& segment) {
  const Trajectory& trajectory = Rendered().trajectory();
  const auto truth = [&](const KeyframeState& x) {
    return trajectory.At(1e-9 * static_cast<double>(x.t_ns));
  };
  const KeyframeState& a = segment.keyframes.front();
  const auto b = truth(a);
  double largest = 0;
  for (const KeyframeState& x : segment.keyframes) {
    const Eigen::Vector3d estimated = a.q_GI.conjugate() * (x.p_GI - a.p_GI);
    const Eigen::Vector3d expected =
        b.q_GI.conjugate() * (truth(x).p_GI - b.p_GI);
    largest = std::max(largest, (estimated - expected).norm());
  }
  return largest;
}

TEST(Odometry, FindsTheMotionOfARecording) {
  Source source;
  const auto segments = All(&source, {.session = "walk", .keyframes = 30});
  ASSERT_EQ(segments.size(), 3u);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const MotionSegment& segment = segments[i].segment;
    EXPECT_EQ(segments[i].failure, "");
    EXPECT_EQ(segment.key.session, "walk");
    EXPECT_EQ(segment.key.index, static_cast<std::int64_t>(i));
    EXPECT_EQ(segment.calibration_version, 3);
    EXPECT_EQ(segment.keyframes.size(), 30u);
    EXPECT_GT(segment.observations.size(), 3000u);
    EXPECT_LT(segments[i].reprojection_rms_px, 0.5);
    EXPECT_LT(PathError_m(segment), 0.01);
    EXPECT_TRUE(segment.imu1.empty());
    EXPECT_TRUE(Validate(segment, HandheldRig("handheld").factory).empty());
  }
  // Neighbours can be joined, and are in one frame.
  for (std::size_t i = 1; i < segments.size(); ++i) {
    const KeyframeState& next = segments[i].segment.keyframes.front();
    EXPECT_GE(segments[i - 1].segment.imu.back().t_ns, next.t_ns);
    const KeyframeState& last = segments[i - 1].segment.keyframes.back();
    EXPECT_LT((next.p_GI - last.p_GI).norm(), 0.3);
  }
}

// Whatever is known of its pose.
TEST(Odometry, ASecondImuAddsItsReadingsAndDoesNotMoveTheStates) {
  Source source;
  const OdometryOptions options = {.session = "walk", .keyframes = 30};
  const auto known = All(&source, options, RigOfTwoImus());
  Rig rig = RigOfTwoImus();
  rig.factory.imu1->q_JI = Exp({0.1, 0, 0}) * rig.factory.imu1->q_JI;
  const auto turned = All(&source, options, rig);
  ASSERT_EQ(turned.size(), 3u);
  ASSERT_EQ(known.size(), 3u);
  for (std::size_t i = 0; i < turned.size(); ++i) {
    const MotionSegment& segment = turned[i].segment;
    EXPECT_LT(PathError_m(segment), 0.01);
    EXPECT_EQ(segment.keyframes.back().p_GI,
              known[i].segment.keyframes.back().p_GI);
    ASSERT_FALSE(segment.imu1.empty());
    EXPECT_LE(segment.imu1.front().t_ns, segment.imu.front().t_ns + 5'000'000);
    EXPECT_GE(segment.imu1.back().t_ns, segment.keyframes.back().t_ns);
    EXPECT_TRUE(Validate(segment, rig.factory).empty());
  }
}

// A folder of the points that a tracker finds in the images gives the segments
// of the images.
TEST(Odometry, TakesTheTracksOfARecordingWithoutImages) {
  Source source;
  FeatureTracker tracker(Rendered().rig().factory, {});
  for (const ImuSample& sample : source.imu()) tracker.AddImu(sample);
  std::string tracks = "time,camera,landmark,x,y\n";
  for (int i = 0; i < Rendered().images(); ++i) {
    GreyPixels pixels = *source.ReadImage(0, i);
    const cv::Mat image(
        pixels.height_px, pixels.width_px, CV_8UC1, pixels.pixels.data());
    for (const TrackPoint& point :
         tracker.Track(Rendered().stamp_ns(i), {image})) {
      tracks += fmt::format("{},0,{},{},{}\n",
                            Rendered().stamp_ns(i),
                            point.landmark,
                            point.z_px.x(),
                            point.z_px.y());
    }
  }
  std::string imu;
  for (const ImuSample& sample : source.imu()) {
    imu += fmt::format("{},{},{},{},{},{},{}\n",
                       sample.t_ns,
                       sample.gyro.x(),
                       sample.gyro.y(),
                       sample.gyro.z(),
                       sample.accel.x(),
                       sample.accel.y(),
                       sample.accel.z());
  }
  const TempFolder folder;
  WriteBytes(folder.File("tracks.csv"), tracks);
  WriteBytes(folder.File("imu.csv"), imu);
  const auto recording = OpenRecording(folder.path(), {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const OdometryOptions options = {.session = "walk", .keyframes = 30};
  const auto of_images = All(&source, options);
  const auto of_tracks = All(recording->get(), options);
  ASSERT_EQ(of_images.size(), 3u);
  ASSERT_EQ(of_tracks.size(), of_images.size());
  for (std::size_t i = 0; i < of_images.size(); ++i) {
    const MotionSegment& a = of_images[i].segment;
    const MotionSegment& b = of_tracks[i].segment;
    ASSERT_EQ(a.observations.size(), b.observations.size());
    ASSERT_EQ(a.keyframes.size(), b.keyframes.size());
    for (std::size_t k = 0; k < a.keyframes.size(); ++k) {
      EXPECT_LT((a.keyframes[k].p_GI - b.keyframes[k].p_GI).norm(), 1e-9);
    }
  }
}

TEST(Odometry, GivesTheSameSegmentsAgain) {
  Source source;
  const auto a = All(&source, {.session = "walk"});
  const auto b = All(&source, {.session = "walk"});
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    const MotionSegment& one = a[i].segment;
    const MotionSegment& other = b[i].segment;
    ASSERT_EQ(one.observations.size(), other.observations.size());
    for (std::size_t k = 0; k < one.keyframes.size(); ++k) {
      EXPECT_EQ(one.keyframes[k].p_GI, other.keyframes[k].p_GI);
      EXPECT_EQ(one.keyframes[k].b_a, other.keyframes[k].b_a);
    }
    for (std::size_t o = 0; o < one.observations.size(); ++o) {
      EXPECT_EQ(one.observations[o].z_px, other.observations[o].z_px);
    }
  }
}

TEST(Odometry, ContinuesAfterAStamp) {
  Source source;
  const auto all = All(&source, {.session = "walk", .keyframes = 30});
  ASSERT_EQ(all.size(), 3u);
  const std::int64_t end_ns = all[0].segment.keyframes.back().t_ns;
  const auto rest = All(&source,
                        {.session = "walk",
                         .first_index = 2,
                         .after_ns = end_ns,
                         .keyframes = 30});
  ASSERT_EQ(rest.size(), 2u);
  EXPECT_EQ(rest[0].segment.key.index, 2);
  EXPECT_GT(rest[0].segment.keyframes.front().t_ns, end_ns);
  EXPECT_LT(PathError_m(rest[0].segment), 0.01);
  // Landmarks of both are different ones.
  std::set<std::uint64_t> ids;
  for (const Landmark& one : all[0].segment.landmarks) ids.insert(one.id);
  for (const Landmark& one : rest[0].segment.landmarks) {
    EXPECT_FALSE(ids.contains(one.id));
  }
}

TEST(Odometry, BeginsAfreshAfterAGap) {
  Source source({.gap_from = 90, .gap_to = 120});
  const auto segments =
      All(&source, {.session = "walk", .keyframes = 30, .min_keyframes = 10});
  ASSERT_EQ(segments.size(), 4u);
  const std::int64_t gap_ns = Rendered().stamp_ns(89);
  std::int64_t before = -1;
  std::set<std::uint64_t> ids;
  for (const OdometrySegment& one : segments) {
    EXPECT_EQ(one.failure, "");
    EXPECT_LT(PathError_m(one.segment), 0.01);
    EXPECT_TRUE(Validate(one.segment, HandheldRig("handheld").factory).empty());
    const bool after = one.segment.keyframes.front().t_ns > gap_ns;
    EXPECT_TRUE(after || one.segment.keyframes.back().t_ns <= gap_ns);
    if (after && before >= 0) {
      EXPECT_GT(one.segment.key.index, before + 1);
      for (const Landmark& landmark : one.segment.landmarks) {
        EXPECT_FALSE(ids.contains(landmark.id));
      }
      before = -1;
    } else if (!after) {
      before = one.segment.key.index;
      for (const Landmark& landmark : one.segment.landmarks) {
        ids.insert(landmark.id);
      }
    }
  }
}

TEST(Odometry, LeavesOutImagesThatCannotBeRead) {
  Source source({.unreadable = {30, 31, 77, 140}});
  const Rig rig = HandheldRig("handheld");
  Odometry odometry(&source, rig, rig.factory, {.session = "walk"});
  int found = 0;
  for (;;) {
    auto next = odometry.Next(rig.factory, 1);
    ASSERT_TRUE(next.ok());
    if (!*next) break;
    EXPECT_EQ((*next)->failure, "");
    EXPECT_LT(PathError_m((*next)->segment), 0.01);
    ++found;
  }
  EXPECT_EQ(found, 3);
  EXPECT_EQ(odometry.progress().unreadable, 4u);
  EXPECT_EQ(odometry.progress().last_error, "damaged");
}

TEST(Odometry, EndsIfMostImagesCannotBeRead) {
  Faults faults;
  for (int i = 0; i < 1000; ++i) faults.unreadable.insert(i);
  Source source(faults);
  const Rig rig = HandheldRig("handheld");
  Odometry odometry(&source, rig, rig.factory, {.session = "walk"});
  const auto next = odometry.Next(rig.factory, 1);
  EXPECT_EQ(next.status().code(), absl::StatusCode::kDataLoss);
}

TEST(Odometry, RefusesImagesOfAnotherSize) {
  Source source({.small = true});
  const Rig rig = HandheldRig("handheld");
  Odometry odometry(&source, rig, rig.factory, {.session = "walk"});
  const auto next = odometry.Next(rig.factory, 1);
  EXPECT_EQ(next.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(next.status().message(),
            "the images of cam0 have 2 x 2 px, while the calibration is for "
            "640 x 480 px");
}

// Images of EuRoC V1_01, of a drone that hardly moves: the motion is found, and
// a calibration on it is about as uncertain as the factory's.
TEST(Odometry, FindsTheMotionOfRealImages) {
  const std::filesystem::path folder =
      std::filesystem::path(SELFCAL_DATA_DIR) / "euroc_images";
  if (!std::filesystem::exists(folder)) {
    GTEST_SKIP() << "no recordings beside the checkout: " << folder;
  }
  auto recording = OpenRecording(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  Rig rig = HandheldRig("euroc");
  rig.factory = {};
  rig.pixel_sigma_px = 0.5;
  for (const RecordedCamera& camera : (*recording)->cameras()) {
    rig.factory.cameras.push_back(*camera.calibration);
  }
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  rig.prior_sigmas = {{"*.focal.*", 20},
                      {"*.principal.*", 15},
                      {"*.q_CI.*", 0.05},
                      {"*.p_CI.*", 0.05},
                      {"*.time_offset", 0.05}};
  Odometry odometry(recording->get(), rig, rig.factory, {.session = "v1_01"});
  auto next = odometry.Next(rig.factory, 1);
  ASSERT_TRUE(next.ok()) << next.status();
  ASSERT_TRUE(next->has_value());
  const OdometrySegment& found = **next;
  EXPECT_EQ(found.failure, "");
  EXPECT_LT(found.reprojection_rms_px, 1);
  EXPECT_TRUE(Validate(found.segment, rig.factory).empty());
  CalibrateOptions options;
  options.prior = FactoryPrior(rig);
  const CalibrationResult result =
      Calibrate(rig, rig.factory, {found.segment}, options);
  ASSERT_GT(result.covariance.size(), 0);
  const Eigen::VectorXd sigmas = result.covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd priors = PriorSigmas(rig);
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  for (const int i : FreeComponents(rig)) {
    EXPECT_LT(sigmas[i], 3 * priors[i]) << components[i].name;
  }
}

}  // namespace
}  // namespace selfcal::client
