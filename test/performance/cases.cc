#include "test/performance/cases.h"

namespace selfcal {

Measurement CompareTimes(const TimedFunction& a,
                         const TimedFunction& b,
                         const TimingOptions& options,
                         Clock clock) {
  const std::vector<Times> times = TimeInTurns({a, b}, options, clock);
  return {.ratio = MedianRatio(times[0], times[1]),
          .figures = {{a.name + " [ms]", Median(times[0])},
                      {b.name + " [ms]", Median(times[1])}}};
}

}  // namespace selfcal
