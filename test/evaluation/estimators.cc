#include "test/evaluation/estimators.h"

#include <limits>
#include <numeric>
#include <stdexcept>

#include "core/information/segment_scorer.h"
#include "core/selection/tables.h"
#include "core/simulation/random.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kRandomSegmentsStream = 501;

SegmentSet Indices(const std::vector<Table>& tables) {
  SegmentSet set;
  for (const TableEntry& entry : UnionOfTables(tables)) {
    set.push_back(static_cast<int>(entry.sequence));
  }
  return set;
}

enum class Order { kMost, kLeast };

SegmentSet FillTables(const Rig& rig,
                      Order order,
                      const std::vector<SegmentInformation>& scores) {
  std::vector<Table> tables = MakeTables(rig);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    for (std::size_t q = 0; q < tables.size(); ++q) {
      const GroupScore& score = scores[i].groups[q];
      const auto sequence = static_cast<std::int64_t>(i);
      if (order == Order::kMost) {
        Offer({{"", sequence}, sequence, score.entropy, score.gain},
              rig.min_gain_nats,
              &tables[q]);
      } else {
        Offer({{"", sequence}, sequence, -score.entropy, score.gain},
              -std::numeric_limits<double>::infinity(),
              &tables[q]);
      }
    }
  }
  return Indices(tables);
}

// One table over all of theta.
SegmentSet FillTable(const Rig& rig,
                     int capacity,
                     Order order,
                     const std::vector<SegmentInformation>& scores) {
  Rig single = rig;
  single.groups = {{"theta", {"*"}}};
  single.table_size = capacity;
  std::vector<SegmentInformation> of_all(scores.size());
  for (std::size_t i = 0; i < scores.size(); ++i) {
    of_all[i].groups = ScoreGroups(single, scores[i].Lambda);
  }
  return FillTables(single, order, of_all);
}

}  // namespace

std::vector<SegmentInformation> ScoreAll(
    const Rig& rig, const std::vector<MotionSegment>& segments) {
  SegmentScorer scorer;
  std::vector<SegmentInformation> scores(segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i) {
    scorer.Score(rig, rig.factory, segments[i], {}, &scores[i]);
  }
  return scores;
}

SegmentSet MostInformative(const Rig& rig,
                           const std::vector<SegmentInformation>& scores) {
  return FillTables(rig, Order::kMost, scores);
}

SegmentSet LeastInformative(const Rig& rig,
                            const std::vector<SegmentInformation>& scores) {
  return FillTables(rig, Order::kLeast, scores);
}

SegmentSet SingleGroup(const Rig& rig,
                       int capacity,
                       const std::vector<SegmentInformation>& scores) {
  return FillTable(rig, capacity, Order::kMost, scores);
}

SegmentSet LeastOfSingleGroup(const Rig& rig,
                              int capacity,
                              const std::vector<SegmentInformation>& scores) {
  return FillTable(rig, capacity, Order::kLeast, scores);
}

// The segments with the lowest of numbers that each draws once.
SegmentSet RandomSegments(int count, int size, std::uint64_t seed) {
  Random random(seed, kRandomSegmentsStream);
  Table table{.group = "random", .capacity = size, .entries = {}};
  for (int i = 0; i < count; ++i) {
    Offer({{"", i}, i, random.Uniform(), 0}, 0, &table);
  }
  return Indices({table});
}

SegmentSet AllSegments(int count) {
  SegmentSet all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

std::vector<MotionSegment> Pick(const std::vector<MotionSegment>& segments,
                                const SegmentSet& set) {
  std::vector<MotionSegment> picked;
  for (const int i : set) picked.push_back(segments[i]);
  return picked;
}

CalibrationResult CalibrateOn(const Rig& rig,
                              const std::vector<MotionSegment>& segments,
                              const SegmentSet& set,
                              const CalibrateOptions& options) {
  CalibrationResult result =
      Calibrate(rig, rig.factory, Pick(segments, set), options);
  if (result.status != CalibrateStatus::kConverged) {
    throw std::runtime_error("a calibration did not converge: " +
                             result.message);
  }
  return result;
}

}  // namespace selfcal
