// The thread that verifies a share of what the pipeline computes while the
// device is idle: of newly scored segments, whose score it has computed by the
// other core, and of runs, whose calibration it has computed by both.
//
// Whether a segment or a run belongs to the sample follows from a hash of its
// name: the same ones on every machine and after every start. What is to be
// verified waits in memory, a few segments and runs at most, the newest are
// dropped beyond that: a check that does not take place is made up for by
// others.
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

// Whether what has this name belongs to a sample of that share, in [0, 1].
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

  // Something was computed. Return at once; any thread may call.
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
