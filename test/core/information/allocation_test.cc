// The scoring loop allocates nothing in steady state: counted by a malloc of
// this program, which is therefore a separate program.
#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <vector>

#include "core/information/segment_scorer.h"
#include "test/core/information/test_segments.h"

namespace {

std::atomic<int> allocations = 0;

}  // namespace

extern "C" {

// The allocator of the C library.
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
  ++allocations;
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  ++allocations;
  *memory = __libc_memalign(alignment, size);
  return 0;
}

}  // extern "C"

namespace selfcal {
namespace {

struct Scene {
  Rig rig;
  std::vector<MotionSegment> segments;
};

// Moving segments of different sizes, all of theta observed.
Scene MakeScene(const Rig& rig) {
  Scene scene;
  scene.rig = rig;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = seed % 2 == 0 ? 40 : 30;
    const Calibration theta = PerturbCalibration(rig.factory, {}, seed);
    scene.segments.push_back(
        OneSegment(rig, theta, *MakeHandheld(4.1, 1, seed), options).slam);
  }
  return scene;
}

TEST(SegmentScorer, AllocatesNothingInSteadyState) {
  Rig moving = TwoCameraRig();
  moving.blocks = {{"*.time_offset", true}};
  moving.factory.cameras[0].time_offset_s = 0.01;
  for (const Rig& rig : {HandheldRig("handheld"), TwoCameraRig(), moving}) {
    const Scene scene = MakeScene(rig);
    for (const VectorWidth width :
         {VectorWidth::k2, VectorWidth::k4, VectorWidth::k8}) {
      if (!HasVectors(width)) continue;
      SCOPED_TRACE(VectorWidthName(width));
      SegmentScorer scorer(width);
      SegmentInformation result;
      const std::size_t free = FreeComponents(scene.rig).size();
      const auto score_all = [&] {
        for (const MotionSegment& segment : scene.segments) {
          scorer.Score(scene.rig, scene.rig.factory, segment, {}, &result);
          ASSERT_EQ(result.rank, free);
        }
      };
      const int before = allocations;
      score_all();
      EXPECT_GT(allocations, before);  // it does count
      const int warm = allocations;
      score_all();
      score_all();
      EXPECT_EQ(allocations, warm);
    }
  }
}

}  // namespace
}  // namespace selfcal
