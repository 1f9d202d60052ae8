// What the phases of a run share: the domain and its store, settings, the
// computations, and those who watch runs.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "server/domain/domain.h"
#include "server/pipeline/current_run.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/rig_claims.h"
#include "server/pipeline/watchers.h"
#include "server/store/store.h"

namespace selfcal::server {

// For one thread that executes runs. What it points to must outlive it.
struct RunContext {
  Domain* domain;
  RigClaims* claims;
  PipelineOptions options;
  Estimators estimators;
  Watchers<RunUpdate>* watchers;
  CurrentRun* current;
  RigClaim claim;  // of the rig of the current run

  Store* store() const { return domain->store(); }
  // True if the current run is not to go on here.
  bool interrupted() const {
    return current->interrupted() || !claims->Holds(claim);
  }
};

// The topic of the watchers of a run, and the run of a topic.
std::string RunTopic(const std::string& rig, std::int64_t run);
std::pair<std::string, std::int64_t> RunOfTopic(const std::string& topic);

// Publishes a run without or with its newest iteration.
void PublishRun(const RunContext& context, const StoredRun& run);
void PublishStep(const RunContext& context,
                 const StoredRun& run,
                 const CalibrateProgress& progress);

}  // namespace selfcal::server
