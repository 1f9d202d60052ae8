// The fill of all tables of a rig together.
#pragma once

#include <vector>

#include "server/store/store.h"

namespace selfcal::server {

struct TableFill {
  int entries = 0;
  int capacity = 0;
};

inline TableFill FillOf(const std::vector<Table>& tables) {
  TableFill fill;
  for (const Table& table : tables) {
    fill.entries += static_cast<int>(table.entries.size());
    fill.capacity += static_cast<int>(table.capacity);
  }
  return fill;
}

}  // namespace selfcal::server
