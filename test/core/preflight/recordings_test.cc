// The real recordings as they are, and with each of the usual mistakes planted.
#include "test/recordings.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "client/import/vi_map.h"
#include "test/core/preflight/expect_found.h"
#include "test/core/preflight/mistakes.h"

namespace selfcal {
namespace {

FedData Read(const std::string& path, int keyframes) {
  const auto recording = client::ReadViMap(path, {});
  EXPECT_TRUE(recording.ok()) << recording.status();
  FedData data;
  data.rig = recording->rig;
  data.segments = client::BuildSegments(
      *recording, {.session = "recorded", .keyframes = keyframes});
  return data;
}

void ShiftKeyframes(FedData* data, double by_s) {
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.t_ns += static_cast<std::int64_t>(by_s * 1e9);
    }
  }
}

// `harmless`: mistakes that change too little in this recording to be detected,
// or to matter; they need not be reported.
void ExpectAllFound(const FedData& clean,
                    const std::set<std::string>& harmless) {
  const Diagnosis diagnosis = clean.Diagnose();
  ASSERT_TRUE(diagnosis.findings.empty()) << Text(diagnosis);
  for (const Mistake& mistake : Mistakes()) {
    if (!harmless.contains(mistake.name)) {
      ExpectFound(mistake, clean);
      continue;
    }
    FedData fed = clean;
    mistake.plant(&fed);
    const Diagnosis with = fed.Diagnose();
    EXPECT_TRUE(with.findings.empty()) << mistake.name << "\n" << Text(with);
  }
}

// Its camera is rotated by almost 180 degrees relative to the body, which is
// nearly its own inverse: R_CI^2 is a rotation of 7 degrees.
TEST(Recordings, TangoIsCleanAndEveryMistakeIsFound) {
  SELFCAL_NEED_RECORDING(path, "tango_handheld");
  ExpectAllFound(Read(path, 40), {"poses_by_inverted_extrinsics"});
}

TEST(Recordings, EurocIsCleanAndEveryMistakeIsFound) {
  SELFCAL_NEED_RECORDING(path, "euroc_v1_01");
  ExpectAllFound(Read(path, 20), {});
}

// This recording has an actual mistake, which both halves of it reveal.
TEST(Recordings, RoomHasAnOffsetOfTime) {
  SELFCAL_NEED_RECORDING(path, "equidistant_room");
  const FedData whole = Read(path, 20);
  FedData first = whole, second = whole;
  ASSERT_GE(whole.segments.size(), 3);
  first.segments.resize(1);
  second.segments.erase(second.segments.begin(), second.segments.end() - 1);
  for (const FedData& data : {whole, first, second}) {
    const Diagnosis diagnosis = data.Diagnose();
    ASSERT_EQ(Kinds(diagnosis), std::vector{FindingKind::kTimeOffset})
        << Text(diagnosis);
    EXPECT_NEAR(diagnosis.findings[0].value, 0.0187, 2e-3) << Text(diagnosis);
  }
}

// Its camera, too, is rotated by almost 180 degrees.
TEST(Recordings, RoomIsCleanWithItsOffsetCorrectedAndEveryMistakeIsFound) {
  SELFCAL_NEED_RECORDING(path, "equidistant_room");
  FedData data = Read(path, 20);
  ShiftKeyframes(&data, 0.0187);
  ExpectAllFound(data, {"rotation_inverted", "poses_by_inverted_extrinsics"});
}

}  // namespace
}  // namespace selfcal
