// A finding of a check of the database.
#pragma once

#include <string>

namespace selfcal::server {

struct StoreProblem {
  std::string place;  // e.g. "payloads, row 7"
  std::string description;
};

}  // namespace selfcal::server
