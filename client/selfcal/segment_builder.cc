#include "client/selfcal/segment_builder.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

namespace selfcal::client {
namespace {

struct Keyframe {
  KeyframeState state;
  std::vector<KeyframeObservation> observations;
};

std::int64_t Nanoseconds(double seconds) {
  constexpr double kMaxSeconds = 1e9;  // keeps the product inside int64
  return std::llround(std::clamp(seconds, 0.0, kMaxSeconds) * 1e9);
}

// later - earlier, for any two times, without overflow.
std::uint64_t Elapsed(std::int64_t later_ns, std::int64_t earlier_ns) {
  return static_cast<std::uint64_t>(later_ns) -
         static_cast<std::uint64_t>(earlier_ns);
}

bool Before(const ImuSample& sample, std::int64_t t_ns) {
  return sample.t_ns < t_ns;
}

// The first observation of each landmark by each camera.
std::vector<KeyframeObservation> WithoutDuplicates(
    std::span<const KeyframeObservation> observations) {
  std::set<std::pair<std::int32_t, std::uint64_t>> seen;
  std::vector<KeyframeObservation> unique;
  unique.reserve(observations.size());
  for (const KeyframeObservation& observation : observations) {
    if (seen.emplace(observation.camera, observation.landmark_id).second) {
      unique.push_back(observation);
    }
  }
  return unique;
}

// Landmarks seen often enough, in the order of their first observation, and
// the observations of them.
void AddLandmarks(std::span<const Keyframe> keyframes,
                  int min_observations,
                  MotionSegment* segment) {
  std::unordered_map<std::uint64_t, int> count;
  for (const Keyframe& keyframe : keyframes) {
    for (const KeyframeObservation& seen : keyframe.observations) {
      ++count[seen.landmark_id];
    }
  }
  std::unordered_map<std::uint64_t, std::int32_t> index;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    for (const KeyframeObservation& seen : keyframes[k].observations) {
      if (count[seen.landmark_id] < min_observations) continue;
      const auto next = static_cast<std::int32_t>(segment->landmarks.size());
      const auto [entry, is_new] = index.emplace(seen.landmark_id, next);
      if (is_new) segment->landmarks.push_back({seen.landmark_id, seen.p_G});
      segment->landmarks[static_cast<std::size_t>(entry->second)].p_G =
          seen.p_G;
      segment->observations.push_back({static_cast<std::int32_t>(k),
                                       seen.camera,
                                       entry->second,
                                       seen.z_px});
    }
  }
}

}  // namespace

struct SegmentBuilder::State {
  SegmentBuilderOptions options;
  std::uint64_t max_gap_ns;
  std::uint64_t seconds_ns;
  std::int64_t next_index;
  // Of the segment at hand and, while IMU samples lag behind, of later ones.
  std::vector<Keyframe> keyframes;
  // From the last sample at or before the first keyframe.
  std::vector<ImuSample> imu;
  std::optional<std::int64_t> last_keyframe_ns;
  std::deque<MotionSegment> complete;
  SegmentBuilderStatistics statistics;

  explicit State(const SegmentBuilderOptions& given)
      : options(given),
        max_gap_ns(static_cast<std::uint64_t>(Nanoseconds(given.max_gap_s))),
        seconds_ns(static_cast<std::uint64_t>(Nanoseconds(given.seconds))),
        next_index(given.first_index) {}

  // Number of keyframes of the segment that begins with the first one, if the
  // keyframe after it has come.
  std::optional<std::size_t> ClosedSize() const {
    for (std::size_t n = 2; n < keyframes.size(); ++n) {
      const bool full =
          options.seconds > 0
              ? Elapsed(keyframes[n].state.t_ns, keyframes[0].state.t_ns) >=
                    seconds_ns
              : n >= static_cast<std::size_t>(std::max(options.keyframes, 2));
      if (full) return n;
    }
    return std::nullopt;
  }

  bool ImuReaches(std::int64_t t_ns) const {
    return !imu.empty() && imu.back().t_ns >= t_ns;
  }

  // Samples from the last one at or before `begin` to the first one at or after
  // `end`.
  std::vector<ImuSample> ImuBetween(std::int64_t begin_ns,
                                    std::int64_t end_ns) const {
    auto first = std::lower_bound(imu.begin(), imu.end(), begin_ns, Before);
    if (first != imu.begin() &&
        (first == imu.end() || first->t_ns > begin_ns)) {
      --first;
    }
    auto last = std::lower_bound(first, imu.end(), end_ns, Before);
    if (last != imu.end()) ++last;
    return {first, last};
  }

  void ForgetImuBefore(std::int64_t t_ns) {
    auto first = std::lower_bound(imu.begin(), imu.end(), t_ns, Before);
    if (first != imu.begin() && (first == imu.end() || first->t_ns > t_ns)) {
      --first;
    }
    imu.erase(imu.begin(), first);
  }

  // The first `size` keyframes leave as a segment whose samples reach `end_ns`.
  void Complete(std::size_t size, std::int64_t end_ns) {
    MotionSegment segment;
    segment.key = {options.session, next_index++};
    segment.calibration_version = options.calibration_version;
    const std::span<const Keyframe> mine(keyframes.data(), size);
    for (const Keyframe& keyframe : mine) {
      segment.keyframes.push_back(keyframe.state);
    }
    segment.imu = ImuBetween(mine.front().state.t_ns, end_ns);
    AddLandmarks(mine, options.min_observations, &segment);
    complete.push_back(std::move(segment));
    ++statistics.segments;
    keyframes.erase(keyframes.begin(),
                    keyframes.begin() + static_cast<std::ptrdiff_t>(size));
    ForgetImuBefore(end_ns);
  }

  // Keyframes before the first sample: no later sample can cover them.
  void DropUncovered() {
    if (imu.empty()) return;
    const auto first =
        std::find_if(keyframes.begin(), keyframes.end(), [&](const auto& k) {
          return k.state.t_ns >= imu.front().t_ns;
        });
    statistics.keyframes_dropped +=
        static_cast<std::uint64_t>(first - keyframes.begin());
    keyframes.erase(keyframes.begin(), first);
  }

  void CompleteWhatIs() {
    DropUncovered();
    while (const auto size = ClosedSize()) {
      const std::int64_t end_ns = keyframes[*size].state.t_ns;
      if (!ImuReaches(end_ns)) return;
      Complete(*size, end_ns);
    }
  }

  void Flush(int min_keyframes) {
    CompleteWhatIs();
    std::size_t covered = keyframes.size();
    while (covered > 0 && !ImuReaches(keyframes[covered - 1].state.t_ns)) {
      --covered;
    }
    if (covered >= static_cast<std::size_t>(std::max(min_keyframes, 2))) {
      Complete(covered, keyframes[covered - 1].state.t_ns);
    }
    statistics.keyframes_dropped += keyframes.size();
    keyframes.clear();
  }
};

SegmentBuilder::SegmentBuilder(const SegmentBuilderOptions& options)
    : state_(std::make_unique<State>(options)) {}
SegmentBuilder::~SegmentBuilder() = default;
SegmentBuilder::SegmentBuilder(SegmentBuilder&&) noexcept = default;
SegmentBuilder& SegmentBuilder::operator=(SegmentBuilder&&) noexcept = default;

bool SegmentBuilder::AddImu(const ImuSample& sample) {
  State& s = *state_;
  if (!s.imu.empty() && sample.t_ns <= s.imu.back().t_ns) {
    ++s.statistics.imu_ignored;
    return false;
  }
  s.imu.push_back(sample);
  s.CompleteWhatIs();
  // A keyframe may lag by max_gap; one that comes later than that cannot
  // continue the segment at hand, and samples older than that are not needed.
  if (!s.keyframes.empty() && sample.t_ns > s.keyframes.back().state.t_ns &&
      Elapsed(sample.t_ns, s.keyframes.back().state.t_ns) > 2 * s.max_gap_ns) {
    s.Flush(s.options.min_keyframes);
  }
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  if (s.keyframes.empty() && Elapsed(sample.t_ns, lowest) > s.max_gap_ns &&
      Elapsed(sample.t_ns, s.imu.front().t_ns) > 2 * s.max_gap_ns) {
    s.ForgetImuBefore(sample.t_ns - static_cast<std::int64_t>(s.max_gap_ns));
  }
  return true;
}

bool SegmentBuilder::AddKeyframe(
    const KeyframeState& state,
    std::span<const KeyframeObservation> observations) {
  State& s = *state_;
  if (s.last_keyframe_ns.has_value() && state.t_ns <= *s.last_keyframe_ns) {
    ++s.statistics.keyframes_refused;
    return false;
  }
  if (!s.keyframes.empty() &&
      Elapsed(state.t_ns, *s.last_keyframe_ns) > s.max_gap_ns) {
    s.Flush(s.options.min_keyframes);
  }
  s.last_keyframe_ns = state.t_ns;
  s.keyframes.push_back({state, WithoutDuplicates(observations)});
  s.CompleteWhatIs();
  return true;
}

std::optional<MotionSegment> SegmentBuilder::Take() {
  State& s = *state_;
  if (s.complete.empty()) return std::nullopt;
  std::optional<MotionSegment> oldest(std::move(s.complete.front()));
  s.complete.pop_front();
  return oldest;
}

void SegmentBuilder::Flush(int min_keyframes) { state_->Flush(min_keyframes); }

std::int64_t SegmentBuilder::next_index() const { return state_->next_index; }

SegmentBuilderStatistics SegmentBuilder::statistics() const {
  return state_->statistics;
}

}  // namespace selfcal::client
