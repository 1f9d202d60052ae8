// The order in which rigs take turns at something that several of them want:
// each gets an equal share of the work, however large its pieces are, and no
// credit for work that it did not want earlier (start-time fair queueing).
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace selfcal::server {

class FairOrder {
 public:
  struct Piece {
    std::string rig;
    double cost = 0;  // in any unit
  };

  // Takes one of the next pieces of all rigs that want one, at most one of
  // each, and returns its index; nullopt if there is none. Equal ones are taken
  // in their order.
  std::optional<std::size_t> Take(const std::vector<Piece>& waiting) {
    if (waiting.empty()) {
      *this = FairOrder();
      return std::nullopt;
    }
    std::map<std::string, double> start;
    std::size_t next = 0;
    double first_end = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      const double begin = StartOf(waiting[i].rig);
      start[waiting[i].rig] = begin;
      if (begin + waiting[i].cost >= first_end) continue;
      first_end = begin + waiting[i].cost;
      next = i;
    }
    const std::string& rig = waiting[next].rig;
    now_ = std::max(now_, start.at(rig));
    start.erase(rig);
    start_ = std::move(start);
    std::erase_if(end_, [this](const auto& end) { return end.second <= now_; });
    end_[rig] = first_end;
    return next;
  }

 private:
  // Since when the rig has waited, unless it has had more than its share.
  double StartOf(const std::string& rig) const {
    if (const auto start = start_.find(rig); start != start_.end()) {
      return start->second;
    }
    const auto end = end_.find(rig);
    return end == end_.end() ? now_ : std::max(now_, end->second);
  }

  // Times are in units of cost, for a rig that gets its share all the time.
  double now_ = 0;
  std::map<std::string, double> start_;  // of the pieces that waited, by rig
  std::map<std::string, double> end_;    // of the last pieces taken, by rig
};

}  // namespace selfcal::server
