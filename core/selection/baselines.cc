#include "core/selection/baselines.h"

#include "core/information/landmark_sketch.h"

namespace selfcal {
namespace {

// The rig with one group of all free components.
Rig WithSingleGroup(Rig rig) {
  rig.groups = {{"all", {"*"}}};
  return rig;
}

std::uint64_t Mixed(std::uint64_t state, std::uint64_t value) {
  return LandmarkHash(state ^ value);
}

// A number in [0, 1).
double RandomScore(std::uint64_t seed, const SegmentKey& key) {
  std::uint64_t state = Mixed(0, seed);
  for (const char c : key.session) {
    state = Mixed(state, static_cast<unsigned char>(c));
  }
  state = Mixed(state, static_cast<std::uint64_t>(key.index));
  return static_cast<double>(state >> 11) * 0x1p-53;
}

// Tables in which the score of each group is replaced by score(entropy,
// segment).
template <typename Score>
std::vector<Table> FillTables(const Rig& rig,
                              std::span<const ScoredSegment> segments,
                              const Score& score) {
  std::vector<Table> tables = MakeTables(rig);
  for (const ScoredSegment& segment : segments) {
    const std::vector<GroupScore> groups =
        ScoreGroups(rig, segment.information->Lambda);
    for (std::size_t q = 0; q < tables.size(); ++q) {
      Offer({segment.key,
             segment.sequence,
             score(groups[q].entropy, segment),
             groups[q].gain},
            rig.min_gain_nats,
            &tables[q]);
    }
  }
  return tables;
}

}  // namespace

std::vector<Table> MostInformativeTables(
    const Rig& rig, std::span<const ScoredSegment> segments) {
  return FillTables(
      rig, segments, [](double entropy, const auto&) { return entropy; });
}

std::vector<Table> LeastInformativeTables(
    const Rig& rig, std::span<const ScoredSegment> segments) {
  return FillTables(
      rig, segments, [](double entropy, const auto&) { return -entropy; });
}

Table SingleGroupTable(const Rig& rig,
                       int capacity,
                       std::span<const ScoredSegment> segments) {
  Rig single = WithSingleGroup(rig);
  single.table_size = capacity;
  return MostInformativeTables(single, segments)[0];
}

Table RandomTable(const Rig& rig,
                  int capacity,
                  std::uint64_t seed,
                  std::span<const ScoredSegment> segments) {
  Rig single = WithSingleGroup(rig);
  single.table_size = capacity;
  return FillTables(single, segments, [&](double, const auto& segment) {
    return RandomScore(seed, segment.key);
  })[0];
}

}  // namespace selfcal
