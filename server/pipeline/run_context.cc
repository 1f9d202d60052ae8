#include "server/pipeline/run_context.h"

#include <fmt/format.h>

namespace selfcal::server {

std::string RunTopic(const std::string& rig, std::int64_t run) {
  return fmt::format("{}/{}", rig, run);
}

std::pair<std::string, std::int64_t> RunOfTopic(const std::string& topic) {
  const std::size_t slash = topic.rfind('/');
  return {topic.substr(0, slash), std::stoll(topic.substr(slash + 1))};
}

void PublishRun(const RunContext& context, const StoredRun& run) {
  PublishStep(context, run, {});
}

void PublishStep(const RunContext& context,
                 const StoredRun& run,
                 const CalibrateProgress& progress) {
  context.watchers->Publish(RunTopic(run.rig, run.run), {run, progress});
}

}  // namespace selfcal::server
