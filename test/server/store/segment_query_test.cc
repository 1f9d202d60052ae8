// A list by query against the plain list, filtered and sorted here.
#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using Order = SegmentQuery::Order;
using Key = std::optional<double>;

class SegmentQueryTest : public StoreTest {
 protected:
  // Segments of two sessions: some without temperature, score or data, and some
  // that are unusable. Several have the same motion.
  void Fill() {
    const Rig rig = CreateTestRig("a");
    groups_ = {rig.groups.front().name, rig.groups.back().name};
    std::mt19937 random(3);
    std::uniform_real_distribution<double> draw(-5, 5);
    for (int k = 0; k < 40; ++k) {
      MotionSegment segment = Segment(k, k % 3 == 0 ? "t" : "s");
      segment.landmarks.resize(segment.landmarks.size() - k % 4);
      std::erase_if(segment.observations, [&](const Observation& seen) {
        return seen.landmark >= static_cast<int>(segment.landmarks.size());
      });
      if (k % 2 == 0) segment.temperature_c = std::round(draw(random));
      for (KeyframeState& x : segment.keyframes) x.v_GI *= 1 + k % 5;
      for (ImuSample& sample : segment.imu) sample.gyro *= 1 + k % 7;
      ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
      if (k >= 30) continue;
      ASSERT_TRUE(domain_
                      ->CommitScore("a",
                                    segment.key,
                                    FakeInformation(rig,
                                                    std::round(draw(random)),
                                                    std::round(draw(random)),
                                                    k))
                      .ok());
    }
    const auto tables = store_->GetTables("a");
    ASSERT_TRUE(tables.ok()) << tables.status();
    for (const Table& table : *tables) {
      ASSERT_FALSE(table.entries.empty());
      Quarantine(table.entries.front().key);
    }
    Quarantine({"s", 35});
    all_ = store_->ListSegments("a", {1000, ""})->items;
    ASSERT_EQ(all_.size(), 40u);
    for (const StoredSegment& segment : all_) {
      const auto exclusions = store_->ListExclusions("a", segment.key);
      ASSERT_TRUE(exclusions.ok()) << exclusions.status();
      for (const Exclusion& exclusion : *exclusions) {
        causes_[segment.sequence].insert(exclusion.cause);
      }
    }
  }

  void Quarantine(const SegmentKey& key) {
    const auto done = domain_->QuarantineSegments(
        "a", key.session, key.index, "eve", "diverged");
    ASSERT_TRUE(done.ok()) << done.status();
  }

  static const GroupScore* Score(const StoredSegment& segment,
                                 const std::string& group) {
    if (!segment.information) return nullptr;
    for (const GroupScore& score : segment.information->groups) {
      if (score.group == group) return &score;
    }
    return nullptr;
  }

  template <typename T, typename Value>
  static bool In(const Range<T>& range, const std::optional<Value>& value) {
    if (!range.least && !range.most) return true;
    return value && (!range.least || *value >= *range.least) &&
           (!range.most || *value <= *range.most);
  }

  bool IsExcluded(const StoredSegment& segment, ExclusionCause cause) const {
    const auto found = causes_.find(segment.sequence);
    return found != causes_.end() && found->second.contains(cause);
  }

  bool Matches(const StoredSegment& segment, const SegmentQuery& query) const {
    const GroupScore* score = Score(segment, query.scored_group);
    return (!query.state || segment.state == *query.state) &&
           (!query.session || segment.key.session == *query.session) &&
           (!query.has_data || segment.has_data == *query.has_data) &&
           (!query.in_table || std::count(segment.tables.begin(),
                                          segment.tables.end(),
                                          *query.in_table) > 0) &&
           In(query.receive_time_ns, std::optional(segment.receive_time_ns)) &&
           In(query.calibration_version,
              std::optional(segment.calibration_version)) &&
           In(query.landmarks, std::optional(segment.landmarks)) &&
           In(query.observations, std::optional(segment.observations)) &&
           In(query.temperature_c, segment.temperature_c) &&
           In(query.angular_rate_radps,
              std::optional(segment.motion->angular_rate_radps)) &&
           In(query.acceleration_mps2,
              std::optional(segment.motion->acceleration_mps2)) &&
           (!query.excluded || IsExcluded(segment, *query.excluded)) &&
           (query.scored_group.empty() ||
            (score != nullptr &&
             In(query.entropy_nats, std::optional(score->entropy)) &&
             In(query.gain_nats, std::optional(score->gain))));
  }

  static Key KeyOf(const StoredSegment& segment, const SegmentQuery& query) {
    const GroupScore* score = Score(segment, query.order_group);
    switch (query.order) {
      case Order::kArrival:
        return segment.sequence;
      case Order::kLandmarks:
        return segment.landmarks;
      case Order::kObservations:
        return segment.observations;
      case Order::kTemperature:
        return segment.temperature_c;
      case Order::kAngularRate:
        return segment.motion->angular_rate_radps;
      case Order::kAcceleration:
        return segment.motion->acceleration_mps2;
      case Order::kEntropy:
        return score == nullptr ? Key() : score->entropy;
      case Order::kGain:
        return score == nullptr ? Key() : score->gain;
    }
    return std::nullopt;
  }

  std::vector<std::int64_t> Expected(const SegmentQuery& query) const {
    std::vector<std::pair<double, std::int64_t>> found;
    for (const StoredSegment& segment : all_) {
      const Key key = KeyOf(segment, query);
      if (key && Matches(segment, query)) {
        found.emplace_back(*key, segment.sequence);
      }
    }
    std::sort(found.begin(), found.end());
    if (query.descending) std::reverse(found.begin(), found.end());
    std::vector<std::int64_t> sequences;
    for (const auto& [key, sequence] : found) sequences.push_back(sequence);
    return sequences;
  }

  // All pages of three, one after the other. An empty rig: of all rigs, of
  // which there is one.
  std::vector<std::int64_t> Listed(const SegmentQuery& query,
                                   const std::string& rig = "a") {
    std::vector<std::int64_t> sequences;
    Page page{3, ""};
    do {
      const auto listed = store_->ListSegments(rig, query, page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return {};
      EXPECT_LE(listed->items.size(), 3u);
      for (const StoredSegment& segment : listed->items) {
        sequences.push_back(segment.sequence);
      }
      page.token = listed->next_token;
    } while (!page.token.empty());
    return sequences;
  }

  SegmentQuery Draw(std::mt19937* random) const {
    const auto pick = [&](int n) {
      return std::uniform_int_distribution<int>(0, n - 1)(*random);
    };
    const auto range = [&](auto least, auto most) {
      Range<decltype(least)> drawn;
      if (pick(3) == 0) drawn.least = least;
      if (pick(3) == 0) drawn.most = most;
      return drawn;
    };
    SegmentQuery query;
    if (pick(3) == 0) {
      query.state = static_cast<SegmentState>(1 + pick(3));
    }
    if (pick(4) == 0) query.session = pick(2) == 0 ? "s" : "t";
    if (pick(4) == 0) query.has_data = pick(2) == 0;
    if (pick(4) == 0) query.in_table = groups_[pick(2)];
    if (pick(6) == 0) query.excluded = kCauses[pick(std::size(kCauses))];
    const StoredSegment& some = all_[pick(40)];
    query.receive_time_ns = range(some.receive_time_ns, INT64_MAX);
    query.landmarks = range(std::int64_t{some.landmarks} - pick(3),
                            std::int64_t{some.landmarks} + pick(3));
    query.observations =
        range(std::int64_t{some.observations} - 5, std::int64_t{1} << 40);
    query.temperature_c = range(-4.0, 1.0 * pick(5));
    if (pick(3) == 0) {
      query.angular_rate_radps = range(some.motion->angular_rate_radps,
                                       2 * some.motion->angular_rate_radps);
      query.acceleration_mps2 = range(some.motion->acceleration_mps2,
                                      2 * some.motion->acceleration_mps2);
    }
    if (pick(3) == 0) {
      query.scored_group = groups_[pick(2)];
      query.entropy_nats = range(-4.0, 1.0 * pick(5));
      query.gain_nats = range(-3.0, 4.0);
    }
    query.order = static_cast<Order>(pick(8));
    query.order_group = groups_[pick(2)];
    query.descending = pick(2) == 0;
    return query;
  }

  static constexpr ExclusionCause kCauses[] = {
      ExclusionCause::kInsufficientGain,
      ExclusionCause::kOutranked,
      ExclusionCause::kReplaced,
      ExclusionCause::kUnusable};

  std::vector<std::string> groups_;
  std::vector<StoredSegment> all_;
  std::map<std::int64_t, std::set<ExclusionCause>> causes_;  // by sequence
};
SELFCAL_STORE_TEST_SUITE(SegmentQueryTest);

TEST_P(SegmentQueryTest, EveryListHoldsWhatItsConditionsSayInItsOrder) {
  ASSERT_NO_FATAL_FAILURE(Fill());
  std::mt19937 random(1);
  int found = 0;
  for (int trial = 0; trial < 700; ++trial) {
    const SegmentQuery query = Draw(&random);
    const auto expected = Expected(query);
    ASSERT_EQ(Listed(query), expected) << "trial " << trial;
    found += !expected.empty();
  }
  EXPECT_GT(found, 150);  // most conditions must not exclude everything
}

TEST_P(SegmentQueryTest, ListsOfAllRigsAreThoseOfTheOnlyRig) {
  ASSERT_NO_FATAL_FAILURE(Fill());
  std::mt19937 random(2);
  int found = 0;
  for (int trial = 0; trial < 500; ++trial) {
    SegmentQuery query = Draw(&random);
    // Every second one is that of a cause alone.
    if (trial % 2 == 0) {
      const bool descending = query.descending;
      query = {};
      query.descending = descending;
      query.excluded = kCauses[trial / 2 % std::size(kCauses)];
    }
    if (query.order == Order::kLandmarks ||
        query.order == Order::kObservations || query.order == Order::kEntropy) {
      continue;
    }
    const auto expected = Expected(query);
    ASSERT_EQ(Listed(query, ""), expected) << "trial " << trial;
    found += !expected.empty();
  }
  EXPECT_GT(found, 200);
}

TEST_P(SegmentQueryTest, ATokenIsOfItsQueryAlone) {
  ASSERT_NO_FATAL_FAILURE(Fill());
  SegmentQuery by_landmarks;
  by_landmarks.order = Order::kLandmarks;
  const auto page = store_->ListSegments("a", by_landmarks, {3, ""});
  ASSERT_TRUE(page.ok()) << page.status();
  SegmentQuery ascending = by_landmarks;
  ascending.descending = false;
  SegmentQuery scored = by_landmarks;
  scored.state = SegmentState::kScored;
  SegmentQuery excluded = by_landmarks;
  excluded.excluded = ExclusionCause::kOutranked;
  SegmentQuery fast = by_landmarks;
  fast.angular_rate_radps.least = 0;
  SegmentQuery accelerated = by_landmarks;
  accelerated.acceleration_mps2.least = 0;
  for (const SegmentQuery& other :
       {SegmentQuery(), ascending, scored, excluded, fast, accelerated}) {
    EXPECT_TRUE(absl::IsInvalidArgument(
        store_->ListSegments("a", other, {3, page->next_token}).status()));
  }
}

}  // namespace
}  // namespace selfcal::server
