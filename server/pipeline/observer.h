// Observer of what happens in the pipeline, for metrics and live updates.
#pragma once

#include <optional>
#include <string>

#include "core/information/segment_information.h"
#include "server/pipeline/verification.h"
#include "server/store/store.h"

namespace selfcal::server {

// Called from the threads of the pipeline and of its callers, concurrently. It
// holds them up: an implementation must return soon, must not throw, and must
// not call the pipeline.
class PipelineObserver {
 public:
  virtual ~PipelineObserver() = default;

  enum class Verdict { kStored, kDuplicate, kRejected, kFailed };
  // A segment was submitted, with this verdict.
  virtual void OnVerdict(const std::string& rig, Verdict verdict) = 0;
  // A segment was scored, in this time, but not yet committed.
  virtual void OnScore(const SegmentInformation& information,
                       double seconds) = 0;
  // A run was deferred, began, completed an iteration, or ended.
  virtual void OnRun(const StoredRun& run) = 0;

  enum class CheckSubject { kScore, kCalibration };
  // A score or a calibration was computed by both cores and compared.
  virtual void OnCheck(CheckSubject subject, VerificationOutcome outcome) = 0;
};

}  // namespace selfcal::server
