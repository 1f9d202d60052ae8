// Entries of a recording in order of time, each time once.
//
// Pure functions, callable from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::client {

// Indices of the entries in order of time. Of those with the same time, only
// the first one is kept. Adds a sentence to *problems if the order was another
// one, and if any are left out: "WHERE: 2 of 40 WHAT ...".
std::vector<std::size_t> OrderOfTime(const std::vector<std::int64_t>& times_ns,
                                     const std::string& where,
                                     const std::string& what,
                                     std::vector<std::string>* problems);

// The same for readings, in place.
void SortByTime(const std::string& where,
                std::vector<ImuSample>* imu,
                std::vector<std::string>* problems);

}  // namespace selfcal::client
