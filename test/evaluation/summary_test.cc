#include "test/evaluation/summary.h"

#include <gtest/gtest.h>

#include <exception>
#include <nlohmann/json.hpp>

namespace selfcal {
namespace {

TEST(Figure, HoldsWithinItsBounds) {
  Figure figure{.kind = BoundKind::kWithin, .low = 1, .high = 2};
  for (const double value : {1.0, 1.5, 2.0}) {
    figure.value = value;
    EXPECT_TRUE(figure.Holds()) << value;
  }
  figure.value = 0.99;
  EXPECT_FALSE(figure.Holds());
  figure.kind = BoundKind::kAtMost;
  EXPECT_TRUE(figure.Holds());
  figure.value = 2.01;
  EXPECT_FALSE(figure.Holds());
  figure.kind = BoundKind::kAtLeast;
  EXPECT_TRUE(figure.Holds());
}

TEST(Summary, KeepsTheEntriesOfOtherExperiments) {
  const Figure a{.experiment = "a", .name = "a.x", .value = 1, .high = 2};
  const Figure b{.experiment = "b", .name = "b.x", .value = 3, .high = 2};
  const std::string first = MergeSummary("", {"a", "b"}, {a, b}, false);
  Figure again = a;
  again.name = "a.y";
  const auto merged =
      nlohmann::json::parse(MergeSummary(first, {"a"}, {again}, true));
  ASSERT_EQ(merged.size(), 2u);
  EXPECT_EQ(merged[0].at("name"), "b.x");
  EXPECT_EQ(merged[0].at("holds"), false);
  EXPECT_EQ(merged[0].at("bound"), 2);
  EXPECT_EQ(merged[1].at("name"), "a.y");
  EXPECT_EQ(merged[1].at("quick"), true);
}

TEST(Summary, GivesBothBoundsOfAnInterval) {
  const Figure figure{.experiment = "a",
                      .name = "a.x",
                      .value = 1,
                      .kind = BoundKind::kWithin,
                      .low = 0.5,
                      .high = 2};
  const auto json =
      nlohmann::json::parse(MergeSummary("", {"a"}, {figure}, false));
  EXPECT_EQ(json[0].at("bound"), nlohmann::json({0.5, 2.0}));
}

TEST(Summary, RefusesAFileThatIsNone) {
  EXPECT_THROW(MergeSummary("{", {}, {}, false), std::exception);
}

}  // namespace
}  // namespace selfcal
