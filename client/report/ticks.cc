#include "client/report/ticks.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>

namespace selfcal::client {
namespace {

constexpr int kMostDecimals = 9;
constexpr double kMostFixed = 1e6;  // larger numbers have an exponent
constexpr double kMinute = 60;
constexpr double kHour = 60 * kMinute;
constexpr double kDay = 24 * kHour;
constexpr double kTimeSteps[] = {1,
                                 2,
                                 5,
                                 10,
                                 15,
                                 30,
                                 kMinute,
                                 2 * kMinute,
                                 5 * kMinute,
                                 10 * kMinute,
                                 15 * kMinute,
                                 30 * kMinute,
                                 kHour,
                                 2 * kHour,
                                 3 * kHour,
                                 6 * kHour,
                                 12 * kHour,
                                 kDay,
                                 2 * kDay,
                                 5 * kDay,
                                 10 * kDay,
                                 20 * kDay,
                                 50 * kDay,
                                 100 * kDay,
                                 200 * kDay,
                                 500 * kDay,
                                 1000 * kDay};

// The multiples of `step` in the range, or `least` if there is none.
std::vector<Tick> Multiples(double least, double most, double step) {
  std::vector<Tick> ticks;
  const double slack = 1e-9 * step;
  for (double k = std::ceil((least - slack) / step); k * step <= most + slack;
       ++k) {
    ticks.push_back({k == 0 ? 0 : k * step, "", ""});
  }
  if (ticks.empty()) ticks.push_back({least, "", ""});
  return ticks;
}

double RoundStep(double step) {
  const double power = std::pow(10, std::floor(std::log10(step)));
  for (const double k : {1.0, 2.0, 5.0}) {
    if (k * power >= step * (1 - 1e-9)) return k * power;
  }
  return 10 * power;
}

}  // namespace

std::vector<Tick> NumberTicks(double least,
                              double most,
                              int count,
                              double least_step) {
  if (most <= least) return {{least, fmt::format("{:.3g}", least), ""}};
  const double step =
      RoundStep(std::max(least_step, (most - least) / (count - 1)));
  const int decimals =
      std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  const double size = std::max(std::abs(least), std::abs(most));
  std::vector<Tick> ticks = Multiples(least, most, step);
  for (Tick& tick : ticks) {
    tick.label = decimals > kMostDecimals || size >= kMostFixed
                     ? fmt::format("{:.4g}", tick.value)
                     : fmt::format("{:.{}f}", tick.value, decimals);
  }
  return ticks;
}

std::vector<Tick> TimeTicks(double least, double most, int count) {
  const double wanted = (most - least) / (count - 1);
  const auto* found = std::find_if(std::begin(kTimeSteps),
                                   std::end(kTimeSteps) - 1,
                                   [&](double s) { return s >= wanted; });
  std::vector<Tick> ticks = Multiples(least, most, *found);
  std::string before;
  for (Tick& tick : ticks) {
    const auto time = fmt::gmtime(static_cast<std::time_t>(tick.value));
    const std::string date = fmt::format("{:%Y-%m-%d}", time);
    if (*found >= kDay) {
      tick.label = date;
      continue;
    }
    tick.label = *found >= kMinute ? fmt::format("{:%H:%M}", time)
                                   : fmt::format("{:%H:%M:%S}", time);
    if (date != before) tick.date = date;
    before = date;
  }
  return ticks;
}

}  // namespace selfcal::client
