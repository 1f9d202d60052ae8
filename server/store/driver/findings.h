// Collects the findings of a check of the database, until the caller has
// enough.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <string>
#include <utility>

#include "server/store/driver/store_problem.h"

namespace selfcal::server {

class Findings {
 public:
  // `on_problem` must outlive this; it returns false to end the check.
  explicit Findings(const std::function<bool(const StoreProblem&)>& on_problem)
      : on_problem_(on_problem) {}

  void Add(std::string place, std::string description) {
    if (ended_) return;
    ended_ = !on_problem_({std::move(place), std::move(description)});
  }
  void AddUnlessOk(const std::string& place, const absl::Status& status) {
    if (!status.ok()) Add(place, std::string(status.message()));
  }
  bool ended() const { return ended_; }

 private:
  const std::function<bool(const StoreProblem&)>& on_problem_;
  bool ended_ = false;
};

}  // namespace selfcal::server
