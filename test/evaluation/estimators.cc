#include "test/evaluation/estimators.h"

#include <numeric>
#include <stdexcept>

#include "core/information/segment_scorer.h"
#include "core/selection/baselines.h"
#include "core/selection/tables.h"

namespace selfcal {
namespace {

// With their indices as keys.
std::vector<ScoredSegment> Scored(
    const std::vector<SegmentInformation>& scores) {
  std::vector<ScoredSegment> scored;
  for (const SegmentInformation& score : scores) {
    const auto index = static_cast<std::int64_t>(scored.size());
    scored.push_back({{"", index}, index, &score});
  }
  return scored;
}

SegmentSet Indices(const std::vector<Table>& tables) {
  SegmentSet set;
  for (const TableEntry& entry : UnionOfTables(tables)) {
    set.push_back(static_cast<int>(entry.sequence));
  }
  return set;
}

Rig WithOneGroup(const Rig& rig, int capacity) {
  Rig single = rig;
  single.groups = {{"theta", {"*"}}};
  single.table_size = capacity;
  return single;
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
  return Indices(MostInformativeTables(rig, Scored(scores)));
}

SegmentSet LeastInformative(const Rig& rig,
                            const std::vector<SegmentInformation>& scores) {
  return Indices(LeastInformativeTables(rig, Scored(scores)));
}

SegmentSet SingleGroup(const Rig& rig,
                       int capacity,
                       const std::vector<SegmentInformation>& scores) {
  return MostInformative(WithOneGroup(rig, capacity), scores);
}

SegmentSet LeastOfSingleGroup(const Rig& rig,
                              int capacity,
                              const std::vector<SegmentInformation>& scores) {
  return LeastInformative(WithOneGroup(rig, capacity), scores);
}

SegmentSet RandomSegments(const Rig& rig,
                          int size,
                          std::uint64_t seed,
                          const std::vector<SegmentInformation>& scores) {
  return Indices({RandomTable(rig, size, seed, Scored(scores))});
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
