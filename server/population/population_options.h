// Which cohorts a hub describes, and how often.
#pragma once

#include <string>

namespace selfcal::server {

struct PopulationOptions {
  std::string label = {};  // each of its values is a cohort; empty: none
  double interval_s = 24 * 3600;

  friend bool operator==(const PopulationOptions&,
                         const PopulationOptions&) = default;
};

}  // namespace selfcal::server
