// Hostile bytes in the normal tests: the corpus as it is, and changed copies of
// it. A crash ends the test.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "client/import/vi_map.h"
#include "core/simulation/simulate.h"
#include "proto/convert.h"
#include "test/fuzz/seeds.h"
#include "test/fuzz/targets.h"
#include "test/promise.h"
#include "test/support/files.h"

namespace selfcal {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Corpus(const std::string& target) {
  std::vector<fs::path> paths;
  const fs::path folder = fs::path(SELFCAL_FUZZ_CORPUS) / target;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      paths.push_back(entry.path());
    }
  }
  std::sort(paths.begin(), paths.end());
  std::vector<std::string> inputs;
  for (const fs::path& path : paths) {
    inputs.push_back(ReadBytes(path));
  }
  for (const FuzzSeed& seed : FuzzSeeds()) {
    if (seed.target == target) inputs.push_back(seed.bytes);
  }
  return inputs;
}

// One to four places are overwritten, removed, doubled or taken from another
// input.
class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  std::string Change(std::string bytes, const std::string& other) {
    for (int n = 1 + Below(4); n > 0 && !bytes.empty(); --n) {
      const std::size_t at = Below(bytes.size());
      const std::size_t length =
          std::min<std::size_t>(bytes.size() - at, 1 + Below(16));
      switch (Below(5)) {
        case 0:
          bytes[at] = static_cast<char>(Below(256));
          break;
        case 1:
          bytes[at] ^= static_cast<char>(1 << Below(8));
          break;
        case 2:
          bytes.erase(at, length);
          break;
        case 3:
          bytes.insert(at, bytes.substr(at, length));
          break;
        default:
          bytes.replace(at, length, other, Below(other.size() + 1), length);
      }
    }
    return bytes;
  }

  std::size_t Below(std::size_t n) { return n == 0 ? 0 : random_() % n; }

 private:
  std::mt19937_64 random_;
};

class HostileBytes : public ::testing::TestWithParam<FuzzTarget> {};

TEST_P(HostileBytes, EndNothing) {
  const FuzzTarget& target = GetParam();
  const std::vector<std::string> corpus = Corpus(target.name);
  ASSERT_FALSE(corpus.empty());
  Promise promise("hostile bytes end nothing, " + target.name);
  const auto run = [&](const std::string& bytes) {
    target.run(bytes);
    ++promise.trials;
  };
  for (const std::string& bytes : corpus) run(bytes);
  Mutator mutator(1);
  const int trials = Trials(2000);
  for (int i = 0; i < trials; ++i) {
    const std::string& one = corpus[mutator.Below(corpus.size())];
    const std::string& other = corpus[mutator.Below(corpus.size())];
    run(mutator.Change(one, other));
  }
}

INSTANTIATE_TEST_SUITE_P(Targets,
                         HostileBytes,
                         ::testing::ValuesIn(FuzzTargets()),
                         [](const auto& info) { return info.param.name; });

// Else the targets would be left at the first check, and show nothing.
TEST(FuzzSeeds, AreValid) {
  const Rig rig = HandheldRig("fuzzed");
  int segments = 0;
  for (const FuzzSeed& seed : FuzzSeeds()) {
    if (seed.target != "segment") continue;
    v1::StreamSegmentsRequest request;
    ASSERT_TRUE(request.ParseFromString(seed.bytes));
    MotionSegment segment;
    ASSERT_TRUE(FromProto(request.segment(), "", &segment).empty());
    EXPECT_TRUE(Validate(segment, rig.factory).empty());
    ++segments;
  }
  EXPECT_GE(segments, 2);
}

}  // namespace
}  // namespace selfcal
