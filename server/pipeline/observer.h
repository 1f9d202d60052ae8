// What happens in the pipeline, told to who counts it.
#pragma once

#include <optional>
#include <string>

#include "core/information/segment_information.h"
#include "server/pipeline/verification.h"
#include "server/store/store.h"

namespace selfcal::server {

// Called from the threads of the pipeline and of its callers, several at once.
// It holds them up: an implementation returns soon, does not throw, and does
// not call the pipeline.
class PipelineObserver {
 public:
  virtual ~PipelineObserver() = default;

  enum class Verdict { kStored, kDuplicate, kRejected, kFailed };
  // On each segment that was submitted, with what became of it.
  virtual void OnVerdict(const std::string& rig, Verdict verdict) = 0;
  // A segment was scored, in so many seconds; not yet committed.
  virtual void OnScore(const SegmentInformation& information,
                       double seconds) = 0;
  // A run began, came one iteration further, or ended.
  virtual void OnRun(const StoredRun& run) = 0;

  enum class CheckSubject { kScore, kCalibration };
  // Something was computed by both cores.
  virtual void OnCheck(CheckSubject subject, VerificationOutcome outcome) = 0;
};

}  // namespace selfcal::server
