#include "client/selfcal/observation_filter.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace selfcal::client {
namespace {

Calibration OneCamera() {
  Calibration theta;
  theta.cameras.resize(1);
  theta.cameras[0].width_px = 640;
  theta.cameras[0].height_px = 480;
  return theta;
}

std::vector<std::uint64_t> Ids(const std::vector<KeyframeObservation>& seen) {
  std::vector<std::uint64_t> ids;
  for (const KeyframeObservation& one : seen) ids.push_back(one.landmark_id);
  return ids;
}

using Expected = std::vector<std::uint64_t>;

TEST(ObservationFilter, DropsAndCountsWhatIsOutsideTheImage) {
  const Calibration theta = OneCamera();
  ObservationFilter filter;
  const std::vector<KeyframeObservation> seen = {{0, 1, {320, 240}},
                                                 {0, 2, {-0.5, 240}},
                                                 {0, 3, {-1.5, 240}},
                                                 {0, 4, {320, 482}},
                                                 {0, 5, {640.9, 480.9}}};
  EXPECT_EQ(Ids(filter.Filter(seen, &theta)), (Expected{1, 2, 5}));
  EXPECT_EQ(filter.dropped(), 2u);
  filter.Filter(seen, &theta);
  EXPECT_EQ(filter.dropped(), 4u);
}

TEST(ObservationFilter, DropsOnlyWhatIsNotFiniteIfTheImageIsNotKnown) {
  ObservationFilter filter;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Ids(filter.Filter(
                std::vector<KeyframeObservation>{
                    {0, 1, {-9, 5}}, {0, 2, {nan, 5}}, {3, 3, {5, 5}}},
                nullptr)),
            (Expected{1, 3}));
  EXPECT_EQ(filter.dropped(), 1u);
}

TEST(ObservationFilter, LeavesCamerasThatDoNotExistToTheDaemon) {
  const Calibration theta = OneCamera();
  ObservationFilter filter;
  EXPECT_EQ(
      Ids(filter.Filter(
          std::vector<KeyframeObservation>{{1, 1, {-9, 5}}, {-1, 2, {-9, 5}}},
          &theta)),
      (Expected{1, 2}));
}

TEST(ObservationFilter, MakesIdsThatStartAgainOthers) {
  ObservationFilter filter;
  std::vector<KeyframeObservation> seen;
  for (std::uint64_t id = 0; id < 1000; ++id) seen.push_back({0, id});
  std::set<std::uint64_t> all;
  for (int epoch = 0; epoch < 100; ++epoch) {
    const auto first = Ids(filter.Filter(seen, nullptr));
    EXPECT_EQ(first, Ids(filter.Filter(seen, nullptr))) << "within an epoch";
    all.insert(first.begin(), first.end());
    filter.StartNewIds();
  }
  EXPECT_EQ(all.size(), 100'000u);
}

}  // namespace
}  // namespace selfcal::client
