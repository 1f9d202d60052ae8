#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "client/c/boundary.h"
#include "client/c/calibration.h"
#include "client/c/options.h"
#include "client/c/selfcal.h"
#include "client/selfcal/client.h"

using selfcal::c::Guarded;
using selfcal::c::RequireNotNull;

struct selfcal_watch {
  selfcal_watch(const selfcal::client::ClientOptions& options,
                selfcal_calibration_callback on_new,
                void* user)
      : watch(options,
              [this, on_new, user](
                  const selfcal::client::CalibrationVersion& version) {
                const selfcal_calibration calibration = {
                    selfcal::c::Publish(version)};
                {
                  const std::lock_guard lock(mutex);
                  newest = calibration.published;
                }
                if (on_new != nullptr) on_new(&calibration, user);
              }) {}

  mutable std::mutex mutex;
  // Guarded by mutex; null until the daemon has answered.
  std::shared_ptr<const selfcal::c::PublishedVersion> newest;
  selfcal::client::CalibrationWatch watch;  // last: it uses all of the above
};

int32_t selfcal_watch_create(const selfcal_client_options* options,
                             selfcal_calibration_callback on_new,
                             void* user,
                             selfcal_watch** watch,
                             selfcal_error* error) {
  if (watch != nullptr) *watch = nullptr;
  return Guarded(error, [&] {
    const auto converted = selfcal::c::ToOptions(options);
    if (!converted.ok()) return converted.status();
    auto status = RequireNotNull(watch, "watch");
    if (!status.ok()) return status;
    auto made = std::make_unique<selfcal_watch>(*converted, on_new, user);
    status = selfcal::c::CheckMemory(made->watch.connection_status());
    if (status.ok()) *watch = made.release();
    return status;
  });
}

void selfcal_watch_destroy(selfcal_watch* watch) { delete watch; }

selfcal_calibration* selfcal_watch_newest(const selfcal_watch* watch) {
  if (watch == nullptr) return nullptr;
  return selfcal::c::OrNull([&]() -> selfcal_calibration* {
    const std::lock_guard lock(watch->mutex);
    if (watch->newest == nullptr) return nullptr;
    return new selfcal_calibration{watch->newest};
  });
}

int32_t selfcal_watch_connection_status(const selfcal_watch* watch,
                                        selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(watch, "watch");
    return status.ok() ? watch->watch.connection_status() : status;
  });
}
