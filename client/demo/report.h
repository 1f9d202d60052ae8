// The output of the demo: lines on the terminal, and the same as JSON.
#pragma once

#include <absl/status/status.h>

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/demo/daemon_view.h"
#include "core/model/calibration.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

class Report {
 public:
  Report();

  // Starts a step: "1. device  text".
  void Step(const std::string& name, const std::string& text);
  // Prints one line of detail.
  void Line(const std::string& text);
  // A line that replaces the last one on a terminal; elsewhere it is printed
  // only when `milestone`.
  void Progress(const std::string& text, bool milestone);
  // Reports that a promise of the demo did not hold; the demo then fails.
  void Fail(const std::string& what);

  void Segments(const std::vector<v1::Segment>& segments);
  void Tables(const std::vector<v1::Table>& tables);
  void Run(const v1::Recalibration& run);
  // Prints a table of parameter, unit, truth, factory value (before), estimate,
  // sigma and error in sigmas.
  void Result(const v1::Calibration& factory,
              const v1::Calibration& estimate,
              const std::optional<Calibration>& truth);

  bool failed() const { return failed_; }
  absl::Status WriteJson(const std::string& path) const;

 private:
  void EndProgress();

  const bool terminal_;
  bool progress_open_ = false;
  bool failed_ = false;
  int step_ = 0;
  nlohmann::json json_;
};

// The fill of the tables, e.g. "imu 8/8  camera 5/8".
std::string Fill(const std::vector<v1::Table>& tables);

}  // namespace selfcal::client
