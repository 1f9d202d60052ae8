#include "client/cli/progress.h"

#include <gtest/gtest.h>

#include <cstddef>

namespace selfcal::client {
namespace {

TEST(ProgressLine, FillsWithWhatIsDone) {
  EXPECT_EQ(ProgressLine("import", 0, 3, "", 80),
            "import [------------------------------] 0/3");
  EXPECT_EQ(ProgressLine("import", 1, 3, "", 80),
            "import [##########--------------------] 1/3");
  EXPECT_EQ(ProgressLine("import", 3, 3, "done", 80),
            "import [##############################] 3/3 done");
}

TEST(ProgressLine, NeverWraps) {
  for (std::size_t width = 0; width < 100; ++width) {
    const std::string line =
        ProgressLine("recalibration", 7, 100, "cost 1e7", width);
    EXPECT_LE(line.size() + 1, width == 0 ? 1 : width);
  }
}

TEST(ProgressLine, MakesSenseOfAnyNumbers) {
  EXPECT_NE(ProgressLine("a", 5, 0, "", 80).find("0/0"), std::string::npos);
  EXPECT_NE(ProgressLine("a", 5, 3, "", 80).find("3/3"), std::string::npos);
}

}  // namespace
}  // namespace selfcal::client
