// The thread that verifies a share of the results of the pipeline while the
// device is idle: it computes newly scored segments by the other core, and the
// calibrations of runs by both.
//
// A hash of its name decides whether a segment or a run belongs to the sample:
// the same ones on every machine and after every start. A few segments and runs
// wait in memory; when there are more, the newest are dropped, since others
// make up for a check that is not made.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "server/pipeline/pipeline.h"
#include "server/pipeline/verifier.h"
#include "server/store/store.h"

namespace selfcal::server {

// True if the segment or run of this name belongs to a sample of that share, in
// [0, 1].
bool IsSampled(std::string_view name, double share);

class VerificationSampler {
 public:
  static constexpr std::size_t kMaxWaiting = 4;

  // Both must outlive it.
  VerificationSampler(Store* store,
                      const PipelineOptions& options,
                      Verifier* verifier);
  ~VerificationSampler();

  void Start();
  // Returns when the thread has ended; the verifier must have been stopped.
  void Stop();

  // Report that something was computed. Return at once; any thread may call.
  void OnScore(const Rig& rig,
               const MotionSegment& segment,
               const SegmentInformation& information);
  void OnRun(const StoredRun& run);

 private:
  struct ScoredSegment {
    Rig rig;
    MotionSegment segment;
    SegmentInformation information;
  };
  using Item = std::variant<ScoredSegment, StoredRun>;

  void Put(Item item);
  void Loop();
  bool WaitUntilIdle();  // false when stopping
  absl::Status Check(const Item& item);
  absl::Status CheckScore(const ScoredSegment& scored);
  absl::Status CheckRun(const StoredRun& run);

  Store* const store_;
  const PipelineOptions options_;
  Verifier* const verifier_;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool running_ = false;
  std::deque<Item> waiting_;
  std::thread thread_;
};

}  // namespace selfcal::server
