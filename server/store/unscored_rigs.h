// SQL that finds the rigs with unscored segments without reading each of these:
// there may be many of a rig, while its work is done one after the other.
#pragma once

#include <string>

namespace selfcal::server {

// The beginning of a statement that may read `unscored_rigs (rig)`: the keys of
// the rigs with an unscored segment, and NULL once. Each is one step in the
// index unscored_segments.
inline std::string WithUnscoredRigs() {
  return "WITH RECURSIVE unscored_rigs (rig) AS ("
         "  SELECT (SELECT s.rig FROM segments s WHERE s.state = 1 "
         "    ORDER BY s.rig LIMIT 1) "
         "  UNION ALL "
         "  SELECT (SELECT s.rig FROM segments s "
         "    WHERE s.state = 1 AND s.rig > u.rig ORDER BY s.rig LIMIT 1) "
         "  FROM unscored_rigs u WHERE u.rig IS NOT NULL) ";
}

}  // namespace selfcal::server
