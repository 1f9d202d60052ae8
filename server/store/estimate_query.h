// Selects the parameters of versions to list.
#pragma once

#include <string>

#include "server/store/rig_query.h"

namespace selfcal::server {

struct EstimateQuery {
  RigQuery rigs = {};          // without its order
  std::string component = {};  // e.g. cam0.focal.x; empty: all
  bool only_active = false;    // only of active versions
};

}  // namespace selfcal::server
