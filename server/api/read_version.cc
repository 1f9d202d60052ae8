#include "server/api/read_version.h"

#include "proto/resource_names.h"
#include "server/api/errors.h"
#include "server/encode/versions.h"

namespace selfcal::server {

absl::StatusOr<StoredCalibration> ReadVersion(Store* store,
                                              std::string_view field,
                                              const std::string& name) {
  constexpr char kPattern[] =
      "rigs/{rig}/calibrations/{version}, {version} a number or 'active'";
  const auto parts = ParseChildName(name, "calibrations");
  if (!parts) return BadName(field, kPattern);
  const bool active = parts->id == "active";
  const auto version = ParseCount(parts->id);
  if (!active && !version) return BadName(field, kPattern);
  auto read = active ? store->GetActiveCalibration(parts->rig)
                     : store->GetCalibration(parts->rig, *version);
  if (!read.ok()) {
    return About(read.status(), {kCalibrationType, name, {}});
  }
  return read;
}

}  // namespace selfcal::server
