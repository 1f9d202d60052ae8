#include "server/encode/encode.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

absl::StatusOr<v1::Recalibration> EncodeWithReport(
    Store* store, const StoredRun& run, const CalibrateProgress& progress) {
  if (run.calibration_version == 0) return Encode(run, progress, nullptr);
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredCalibration calibration,
      store->GetCalibration(run.rig, run.calibration_version));
  return Encode(run, progress, &calibration);
}

}  // namespace selfcal::server
