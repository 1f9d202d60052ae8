#include "server/api/version_updates.h"

#include <algorithm>
#include <utility>

#include "selfcal/v1/calibration_service.pb.h"
#include "server/encode/encode.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<std::shared_ptr<const WatchUpdate>> VersionUpdates::Get(
    const std::shared_ptr<const StoredCalibration>& version) {
  // Held while it is encoded: others that come meanwhile want the same.
  const std::lock_guard lock(mutex_);
  const auto known = std::find_if(
      encoded_.begin(), encoded_.end(), [&](const Encoded& encoded) {
        return encoded.version == version;
      });
  if (known != encoded_.end()) return known->update;
  SELFCAL_ASSIGN_OR_RETURN(v1::Calibration message, Encode(store_, *version));
  auto update = std::make_shared<const WatchUpdate>(
      std::make_unique<v1::Calibration>(std::move(message)));
  encoded_.push_front({version, update});
  if (encoded_.size() > kKept) encoded_.pop_back();
  return update;
}

}  // namespace selfcal::server
