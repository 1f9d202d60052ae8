#include "test/evaluation/context.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "test/support/temp_folder.h"

namespace selfcal {
namespace {

TEST(Context, EveryPieceOfWorkIsDoneOnceOnAnyNumberOfThreads) {
  const TempFolder folder;
  for (const int threads : {1, 2, 5}) {
    const Context context(folder.path(), "any", /*quick=*/true, threads);
    std::vector<int> calls(100, 0);
    context.ForEach(100, [&](int i) { ++calls[i]; });
    EXPECT_EQ(calls, std::vector<int>(100, 1)) << threads << " threads";
  }
}

TEST(Context, AnExceptionIsThrownOnceTheOthersHaveEnded) {
  const TempFolder folder;
  for (const int threads : {1, 2, 5}) {
    const Context context(folder.path(), "any", /*quick=*/true, threads);
    std::vector<int> calls(100, 0);
    EXPECT_THROW(context.ForEach(100,
                                 [&](int i) {
                                   ++calls[i];
                                   if (i == 3) throw std::runtime_error("3");
                                 }),
                 std::runtime_error);
    EXPECT_EQ(calls, std::vector<int>(100, 1)) << threads << " threads";
  }
}

}  // namespace
}  // namespace selfcal
