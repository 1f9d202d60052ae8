#include "test/evaluation/plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace selfcal {
namespace {

TEST(Plot, DescribesWhatWasGiven) {
  const Plot plot{.title = "t",
                  .x_label = "x [m]",
                  .log_y = true,
                  .series = {{.label = "s",
                              .style = SeriesStyle::kSteps,
                              .x = {1, 2},
                              .y = {3, 4}}}};
  const auto json = nlohmann::json::parse(Describe(plot));
  EXPECT_EQ(json.at("x_label"), "x [m]");
  EXPECT_EQ(json.at("log_y"), true);
  EXPECT_EQ(json.at("series")[0].at("style"), "steps");
  EXPECT_EQ(json.at("series")[0].at("y"), nlohmann::json({3, 4}));
}

TEST(Plot, RefusesValuesThatAreNotFinite) {
  const Plot plot{.series = {{.x = {1}, .y = {std::nan("")}}}};
  EXPECT_THROW(Describe(plot), std::invalid_argument);
}

TEST(Plot, RefusesLengthsThatDoNotFit) {
  EXPECT_THROW(Describe({.series = {{.x = {1, 2}, .y = {1}}}}),
               std::invalid_argument);
  EXPECT_THROW(Describe({.series = {{.x = {1}, .y = {1}, .low = {1}}}}),
               std::invalid_argument);
  EXPECT_THROW(Describe({.categories = {"a", "b"},
                         .series = {{.style = SeriesStyle::kBars, .y = {1}}}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace selfcal
