// SQL that finds the device change that makes a version outdated.
#pragma once

namespace selfcal::server {

// In a statement whose table `c` is calibrations: the newest change of the
// device that was found after the run of the version was created, other than by
// this run itself, whose result accounts for it; 0: none.
inline constexpr char kChangedSince[] =
    "(SELECT coalesce(max(h.change), 0) FROM runs q "
    " JOIN changes h ON h.rig = q.rig AND h.change > q.change "
    " WHERE q.rig = c.rig AND q.run = c.run AND h.time_ns <> q.end_time_ns)";

}  // namespace selfcal::server
