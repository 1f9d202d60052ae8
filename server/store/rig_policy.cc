#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

using google::protobuf::Duration;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kMaxSeconds = 100LL * 366 * 24 * 3600;

void Put(std::int64_t time_ns, Duration* message) {
  message->set_seconds(time_ns / kSecond);
  message->set_nanos(static_cast<std::int32_t>(time_ns % kSecond));
}

void Get(const Duration& message,
         const char* field,
         std::int64_t* time_ns,
         std::vector<Violation>* violations) {
  if (message.seconds() < 0 || message.seconds() > kMaxSeconds ||
      message.nanos() < 0 || message.nanos() >= kSecond) {
    violations->push_back({field, "must be from 0 to a hundred years"});
    return;
  }
  *time_ns = message.seconds() * kSecond + message.nanos();
}

}  // namespace

void PutPolicy(const RigPolicy& policy, v1::Rig* message) {
  if (policy.table_max_age_ns > 0) {
    Put(policy.table_max_age_ns, message->mutable_table_max_age());
  }
  if (policy.recalibration_min_interval_ns > 0) {
    Put(policy.recalibration_min_interval_ns,
        message->mutable_recalibration_min_interval());
  }
  if (policy.calibration_max_age_ns > 0) {
    Put(policy.calibration_max_age_ns, message->mutable_calibration_max_age());
  }
  for (const WalkDensity& walk : policy.walk_densities) {
    v1::ComponentSetting* added = message->add_walk_densities();
    added->set_pattern(walk.pattern);
    added->set_value(walk.density);
  }
}

std::vector<Violation> GetPolicy(const v1::Rig& message, RigPolicy* policy) {
  std::vector<Violation> violations;
  Get(message.table_max_age(),
      "table_max_age",
      &policy->table_max_age_ns,
      &violations);
  Get(message.recalibration_min_interval(),
      "recalibration_min_interval",
      &policy->recalibration_min_interval_ns,
      &violations);
  Get(message.calibration_max_age(),
      "calibration_max_age",
      &policy->calibration_max_age_ns,
      &violations);
  for (const v1::ComponentSetting& walk : message.walk_densities()) {
    policy->walk_densities.push_back({walk.pattern(), walk.value()});
  }
  return violations;
}

}  // namespace selfcal::server
