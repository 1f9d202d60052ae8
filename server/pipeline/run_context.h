// What the phases of a run share: the domain and its store, settings, the
// computations, and those who watch runs.
#pragma once

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

// Publishes a run without or with its newest iteration.
void PublishRun(const RunContext& context, const StoredRun& run);
void PublishStep(const RunContext& context,
                 const StoredRun& run,
                 const CalibrateProgress& progress);

}  // namespace selfcal::server
