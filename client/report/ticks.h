// Ticks of the axes of charts, as the web console draws them.
#pragma once

#include <string>
#include <vector>

namespace selfcal::client {

struct Tick {
  double value = 0;
  std::string label;
  std::string date;  // of a time, where it differs from that of the tick before
};

// Round numbers from `least` to `most`, both finite: multiples of 1, 2 or 5
// times a power of ten that is at least `least_step`. At most `count`, which is
// at least 2, all with the same decimals; `least` alone if none is in the
// range.
std::vector<Tick> NumberTicks(double least,
                              double most,
                              int count,
                              double least_step = 0);

// Round times in UTC, from seconds to years; `least` and `most` are in seconds
// since 1970.
std::vector<Tick> TimeTicks(double least, double most, int count);

}  // namespace selfcal::client
