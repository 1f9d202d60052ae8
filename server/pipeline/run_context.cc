#include "server/pipeline/run_context.h"

namespace selfcal::server {

void PublishRun(const RunContext& context, const StoredRun& run) {
  PublishStep(context, run, {});
}

void PublishStep(const RunContext& context,
                 const StoredRun& run,
                 const CalibrateProgress& progress) {
  context.watchers->Publish({run, progress});
}

}  // namespace selfcal::server
