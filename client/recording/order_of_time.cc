#include "client/recording/order_of_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

namespace selfcal::client {

std::vector<std::size_t> OrderOfTime(const std::vector<std::int64_t>& times_ns,
                                     const std::string& where,
                                     const std::string& what,
                                     std::vector<std::string>* problems) {
  const std::size_t count = times_ns.size();
  std::size_t late = 0;
  std::size_t latest = 0;
  for (std::size_t i = 1; i < count; ++i) {
    if (times_ns[i] < times_ns[latest]) {
      ++late;
    } else {
      latest = i;
    }
  }
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (late > 0) {
    problems->push_back(
        fmt::format("{}: {} of {} {} are earlier than one before them: sorted "
                    "by time",
                    where,
                    late,
                    count,
                    what));
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) {
      return times_ns[a] < times_ns[b];
    });
  }
  const auto end = std::unique(order.begin(), order.end(), [&](auto a, auto b) {
    return times_ns[a] == times_ns[b];
  });
  if (end != order.end()) {
    problems->push_back(
        fmt::format("{}: {} of {} {} have the timestamp of another one: left "
                    "out",
                    where,
                    order.end() - end,
                    count,
                    what));
    order.erase(end, order.end());
  }
  return order;
}

void SortByTime(const std::string& where,
                std::vector<ImuSample>* imu,
                std::vector<std::string>* problems) {
  std::vector<std::int64_t> times_ns;
  times_ns.reserve(imu->size());
  for (const ImuSample& sample : *imu) times_ns.push_back(sample.t_ns);
  std::vector<ImuSample> sorted;
  sorted.reserve(imu->size());
  for (const std::size_t i :
       OrderOfTime(times_ns, where, "readings", problems)) {
    sorted.push_back((*imu)[i]);
  }
  *imu = std::move(sorted);
}

}  // namespace selfcal::client
