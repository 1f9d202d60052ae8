// The demo's calls to the daemon, one method each. Every method returns the
// error of the call; no state is kept between calls.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

// The state that a restart must not change.
struct DaemonState {
  std::vector<v1::Segment> segments;  // oldest first
  std::vector<v1::Table> tables;
  std::vector<v1::Calibration> calibrations;  // oldest first
};

class DaemonView {
 public:
  DaemonView(const std::string& target, const std::string& rig);
  ~DaemonView();

  absl::Status CreateRig(const Rig& rig);
  absl::StatusOr<v1::Calibration> GetActive();
  absl::StatusOr<DaemonState> GetState();
  absl::StatusOr<std::vector<v1::Table>> GetTables();
  // True while a segment that was stored is not scored.
  absl::StatusOr<bool> HasUnscored();
  // Lists runs, newest first.
  absl::StatusOr<std::vector<v1::Recalibration>> GetRuns();
  absl::StatusOr<v1::Recalibration> StartRun();
  // Calls back with each change of a run until it has ended.
  absl::Status WatchRun(
      const std::string& name,
      const std::function<void(const v1::Recalibration&)>& callback);

 private:
  struct Stubs;
  std::unique_ptr<Stubs> stubs_;
  std::string parent_;
};

}  // namespace selfcal::client
