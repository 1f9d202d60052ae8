#include "client/selfcal/segment_builder.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace selfcal::client {
namespace {

// Without these, a vector that grows would copy every observation.
static_assert(std::is_nothrow_move_constructible_v<ObservedKeyframe>);
static_assert(std::is_nothrow_move_constructible_v<ClosedSegment>);

std::int64_t Nanoseconds(double seconds) {
  constexpr double kMaxSeconds = 1e9;  // keeps the product inside int64
  return std::llround(std::clamp(seconds, 0.0, kMaxSeconds) * 1e9);
}

// Returns later - earlier without overflow, for any two times.
std::uint64_t Elapsed(std::int64_t later_ns, std::int64_t earlier_ns) {
  return static_cast<std::uint64_t>(later_ns) -
         static_cast<std::uint64_t>(earlier_ns);
}

bool Before(const ImuSample& sample, std::int64_t t_ns) {
  return sample.t_ns < t_ns;
}

}  // namespace

struct SegmentBuilder::State {
  SegmentBuilderOptions options;
  std::uint64_t max_gap_ns;
  std::uint64_t seconds_ns;
  std::int64_t next_index;
  // Keyframes of the current segment and, while IMU samples lag behind, of
  // later ones.
  std::vector<ObservedKeyframe> keyframes;
  // Samples from the last one at or before the first keyframe.
  std::vector<ImuSample> imu;
  std::optional<std::int64_t> last_keyframe_ns;
  std::optional<double> temperature_c;
  std::deque<ClosedSegment> closed;
  SegmentBuilderStatistics statistics;

  explicit State(const SegmentBuilderOptions& given)
      : options(given),
        max_gap_ns(static_cast<std::uint64_t>(Nanoseconds(given.max_gap_s))),
        seconds_ns(static_cast<std::uint64_t>(Nanoseconds(given.seconds))),
        next_index(given.first_index) {}

  // Number of keyframes of the segment that starts with the first keyframe, if
  // the keyframe after the segment has arrived.
  std::optional<std::size_t> ClosedSize() const {
    if (options.seconds > 0) {
      for (std::size_t n = 2; n < keyframes.size(); ++n) {
        if (Elapsed(keyframes[n].state.t_ns, keyframes[0].state.t_ns) >=
            seconds_ns) {
          return n;
        }
      }
      return std::nullopt;
    }
    const auto full = static_cast<std::size_t>(std::max(options.keyframes, 2));
    if (keyframes.size() > full) return full;
    return std::nullopt;
  }

  bool ImuReaches(std::int64_t t_ns) const {
    return !imu.empty() && imu.back().t_ns >= t_ns;
  }

  // Returns the last sample at or before the time, or else the first sample.
  std::vector<ImuSample>::iterator SampleBefore(std::int64_t t_ns) {
    const auto first = std::lower_bound(imu.begin(), imu.end(), t_ns, Before);
    const bool at = first != imu.end() && first->t_ns == t_ns;
    return first == imu.begin() || at ? first : first - 1;
  }

  // Closes a segment of the first `size` keyframes, with samples up to
  // `end_ns`.
  void Close(std::size_t size, std::int64_t end_ns) {
    // Allocations come first: if one fails, nothing has changed.
    ClosedSegment segment;
    segment.key = {options.session, next_index};
    segment.calibration_version = options.calibration_version;
    segment.min_observations = options.min_observations;
    segment.temperature_c = temperature_c;
    segment.end_ns = end_ns;
    std::vector<ObservedKeyframe> next_keyframes;
    next_keyframes.reserve(keyframes.size());
    std::vector<ImuSample> next_imu;
    next_imu.reserve(imu.size() + imu.size() / 8);
    closed.push_back(std::move(segment));

    const auto middle = keyframes.begin() + static_cast<std::ptrdiff_t>(size);
    next_keyframes.insert(next_keyframes.end(),
                          std::move_iterator(middle),
                          std::move_iterator(keyframes.end()));
    keyframes.erase(middle, keyframes.end());
    next_imu.insert(next_imu.end(), SampleBefore(end_ns), imu.end());
    closed.back().keyframes =
        std::exchange(keyframes, std::move(next_keyframes));
    closed.back().imu = std::exchange(imu, std::move(next_imu));
    ++next_index;
    ++statistics.segments;
  }

  // Drops keyframes before the first sample, which no later sample can cover.
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

  void CloseWhatIs() {
    DropUncovered();
    while (const auto size = ClosedSize()) {
      const std::int64_t end_ns = keyframes[*size].state.t_ns;
      if (!ImuReaches(end_ns)) return;
      Close(*size, end_ns);
    }
  }

  void Flush(int min_keyframes) {
    CloseWhatIs();
    std::size_t covered = keyframes.size();
    while (covered > 0 && !ImuReaches(keyframes[covered - 1].state.t_ns)) {
      --covered;
    }
    if (covered >= static_cast<std::size_t>(std::max(min_keyframes, 2))) {
      Close(covered, keyframes[covered - 1].state.t_ns);
    }
    statistics.keyframes_dropped += keyframes.size();
    keyframes.clear();
  }

  bool AddImu(const ImuSample& sample);
  bool AddKeyframe(const KeyframeState& state,
                   std::span<const KeyframeObservation> observations);
  // True if samples that have not arrived by this time will not arrive.
  bool IsStarved(std::int64_t t_ns) const;
  void GiveUp();
};

bool SegmentBuilder::State::AddImu(const ImuSample& sample) {
  if (!imu.empty() && sample.t_ns <= imu.back().t_ns) {
    ++statistics.imu_ignored;
    return false;
  }
  imu.push_back(sample);
  CloseWhatIs();
  // A keyframe may lag by max_gap. A keyframe that lags more cannot continue
  // the current segment, so that older samples are not needed.
  if (!keyframes.empty() && sample.t_ns > keyframes.back().state.t_ns &&
      Elapsed(sample.t_ns, keyframes.back().state.t_ns) > 2 * max_gap_ns) {
    Flush(options.min_keyframes);
  }
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  if (keyframes.empty() && Elapsed(sample.t_ns, lowest) > max_gap_ns &&
      Elapsed(sample.t_ns, imu.front().t_ns) > 2 * max_gap_ns) {
    const auto oldest = sample.t_ns - static_cast<std::int64_t>(max_gap_ns);
    imu.erase(imu.begin(), SampleBefore(oldest));
  }
  return true;
}

bool SegmentBuilder::State::IsStarved(std::int64_t t_ns) const {
  if (keyframes.empty()) return false;
  const std::int64_t since =
      imu.empty() ? keyframes.front().state.t_ns
                  : std::max(imu.back().t_ns, keyframes.front().state.t_ns);
  return t_ns > since && Elapsed(t_ns, since) > 2 * max_gap_ns;
}

bool SegmentBuilder::State::AddKeyframe(
    const KeyframeState& state,
    std::span<const KeyframeObservation> observations) {
  if (last_keyframe_ns.has_value() && state.t_ns <= *last_keyframe_ns) {
    ++statistics.keyframes_refused;
    return false;
  }
  const bool gap =
      !keyframes.empty() && Elapsed(state.t_ns, *last_keyframe_ns) > max_gap_ns;
  if (gap || IsStarved(state.t_ns)) Flush(options.min_keyframes);
  keyframes.push_back({state, {observations.begin(), observations.end()}});
  last_keyframe_ns = state.t_ns;
  CloseWhatIs();
  return true;
}

// Frees everything that is held, after memory ran out.
void SegmentBuilder::State::GiveUp() {
  ++statistics.out_of_memory;
  statistics.keyframes_dropped += keyframes.size();
  std::vector<ObservedKeyframe>().swap(keyframes);
  std::vector<ImuSample>().swap(imu);
}

SegmentBuilder::SegmentBuilder(const SegmentBuilderOptions& options) noexcept {
  try {
    state_ = std::make_unique<State>(options);
  } catch (const std::bad_alloc&) {
    state_ = nullptr;  // as documented: refuses everything
  }
}
SegmentBuilder::~SegmentBuilder() = default;
SegmentBuilder::SegmentBuilder(SegmentBuilder&&) noexcept = default;
SegmentBuilder& SegmentBuilder::operator=(SegmentBuilder&&) noexcept = default;

bool SegmentBuilder::AddImu(const ImuSample& sample) noexcept {
  if (state_ == nullptr) return false;
  try {
    return state_->AddImu(sample);
  } catch (...) {
    state_->GiveUp();
    return false;
  }
}

bool SegmentBuilder::AddKeyframe(
    const KeyframeState& state,
    std::span<const KeyframeObservation> observations) noexcept {
  if (state_ == nullptr) return false;
  try {
    return state_->AddKeyframe(state, observations);
  } catch (...) {
    state_->GiveUp();
    return false;
  }
}

bool SegmentBuilder::SetTemperature(
    std::optional<double> temperature_c) noexcept {
  if (state_ == nullptr) return false;
  constexpr SegmentLimits kLimits;
  const bool possible =
      !temperature_c || (*temperature_c >= kLimits.min_temperature_c &&
                         *temperature_c <= kLimits.max_temperature_c);
  if (possible) state_->temperature_c = temperature_c;
  return possible;
}

std::optional<ClosedSegment> SegmentBuilder::TakeClosed() noexcept {
  if (state_ == nullptr || state_->closed.empty()) return std::nullopt;
  std::optional<ClosedSegment> oldest(std::move(state_->closed.front()));
  state_->closed.pop_front();
  return oldest;
}

std::optional<MotionSegment> SegmentBuilder::Take() noexcept {
  while (const auto closed = TakeClosed()) {
    try {
      return Assemble(*closed);
    } catch (...) {
      ++state_->statistics.out_of_memory;
      --state_->statistics.segments;
      state_->statistics.keyframes_dropped += closed->keyframes.size();
    }
  }
  return std::nullopt;
}

void SegmentBuilder::Flush(int min_keyframes) noexcept {
  if (state_ == nullptr) return;
  try {
    state_->Flush(min_keyframes);
  } catch (...) {
    state_->GiveUp();
  }
}

std::int64_t SegmentBuilder::next_index() const noexcept {
  return state_ == nullptr ? 0 : state_->next_index;
}

SegmentBuilderStatistics SegmentBuilder::statistics() const noexcept {
  return state_ == nullptr ? SegmentBuilderStatistics{} : state_->statistics;
}

}  // namespace selfcal::client
