#pragma once

#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

inline std::vector<std::string> Names(const std::vector<Loss>& losses) {
  std::vector<std::string> names;
  for (const Loss& loss : losses) names.push_back(loss.name);
  return names;
}

}  // namespace selfcal::client
