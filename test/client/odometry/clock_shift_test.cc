// Recordings whose images and readings have different clocks.
#include "client/odometry/clock_shift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "test/core/initialisation/simulated_tracks.h"
#include "test/core/simulation/rigs.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;

constexpr double kTimeOffset_s = 0.02;

Rig Device() {
  Rig rig = HandheldRig("handheld");
  rig.factory.cameras[0].time_offset_s = kTimeOffset_s;
  return rig;
}

// Tracks of a simulated device.
class TrackRecording : public Recording {
 public:
  explicit TrackRecording(const SimulatedTracks& tracks)
      : Recording(DataOf(tracks)) {
    for (const TrackedImage& image : tracks.images) {
      std::vector<RecordedPoint>& points = points_.emplace_back();
      for (const TrackedPoint& point : image.points) {
        points.push_back({point.landmark, point.z_px});
      }
    }
  }

  absl::StatusOr<GreyPixels> ReadImage(int, int) override {
    return absl::NotFoundError("there are tracks instead of images");
  }
  const std::vector<RecordedPoint>* Points(int, int image) const override {
    return &points_[static_cast<std::size_t>(image)];
  }

 private:
  static RecordedData DataOf(const SimulatedTracks& tracks) {
    RecordedData data;
    data.cameras.resize(1);
    data.cameras[0].name = "cam0";
    for (const TrackedImage& image : tracks.images) {
      data.cameras[0].image_times_ns.push_back(image.t_ns);
    }
    data.imu = tracks.samples;
    return data;
  }

  std::vector<std::vector<RecordedPoint>> points_;
};

std::unique_ptr<TrackRecording> Record(double excitation, double shift_s) {
  auto recording = std::make_unique<TrackRecording>(SimulateTracksOf(
      Device(), *MakeHandheld(30, excitation, 3), TrackOptions(3)));
  recording->ShiftReadings(std::llround(1e9 * shift_s));
  return recording;
}

// The shift in seconds, of a device whose time offset is taken for zero.
double ShiftOf(std::unique_ptr<TrackRecording> recording,
               const UnknownOfCamera& unknown = {}) {
  Calibration theta = Device().factory;
  theta.cameras[0].time_offset_s = 0;
  const auto found = FindClockShift(recording.get(), theta, unknown);
  EXPECT_TRUE(found.ok()) << found.status();
  return found.ok() ? 1e-9 * static_cast<double>(*found) : NAN;
}

TEST(FindClockShift, IsZeroWithinTheRangeOfATimeOffset) {
  EXPECT_EQ(ShiftOf(Record(1, 0)), 0);
  EXPECT_EQ(ShiftOf(Record(1, 0.1)), 0);
}

// Images are exposed kTimeOffset_s after their stamp, on the clock of the
// readings.
TEST(FindClockShift, IsWhereTheRotationsAgree) {
  for (const double shift_s : {-7.3, -0.4, 0.3, 9.1}) {
    EXPECT_NEAR(ShiftOf(Record(1, shift_s)), -shift_s - kTimeOffset_s, 1.5e-3);
  }
  EXPECT_NEAR(ShiftOf(Record(1, 4.2), {.rotation = true, .focal = true}),
              -4.2 - kTimeOffset_s,
              1.5e-3);
}

TEST(FindClockShift, MovesReadingsOfAnotherEpoch) {
  for (const double shift_s : {-1e6 + 3, 40.0, 1.7e9}) {
    EXPECT_NEAR(ShiftOf(Record(1, shift_s)), -shift_s - kTimeOffset_s, 1.5e-3);
  }
}

// A device at rest shows nothing: its stamps are believed, unless they cannot
// be true.
TEST(FindClockShift, NeedsMotion) {
  EXPECT_EQ(ShiftOf(Record(0, 3)), 0);
  const auto recording = Record(0, 500);
  const auto found = FindClockShift(recording.get(), Device().factory, {});
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(found.status().message()),
              HasSubstr("have no time in common"));
  EXPECT_THAT(std::string(found.status().message()),
              HasSubstr("hardly turned"));
}

}  // namespace
}  // namespace selfcal::client
