#include "client/selfcal/segment_builder.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "client/selfcal/observation_filter.h"
#include "client/selfcal/pending_keyframe.h"
#include "core/model/rig.h"

namespace selfcal::client {
namespace {

// Largest time between a state and its images.
constexpr std::uint64_t kMaxStateOffset_ns = 500'000'000;

// Without these, a vector that grows would copy every observation.
static_assert(std::is_nothrow_move_constructible_v<PendingKeyframe>);
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

// Times that saturate at the ends of the type.
std::int64_t Earlier(std::int64_t t_ns, std::int64_t by_ns) {
  constexpr auto kLowest = std::numeric_limits<std::int64_t>::min();
  return t_ns < kLowest + by_ns ? kLowest : t_ns - by_ns;
}
std::int64_t Later(std::int64_t t_ns, std::int64_t by_ns) {
  constexpr auto kHighest = std::numeric_limits<std::int64_t>::max();
  return t_ns > kHighest - by_ns ? kHighest : t_ns + by_ns;
}

bool Before(const ImuSample& sample, std::int64_t t_ns) {
  return sample.t_ns < t_ns;
}

// Returns the last sample at or before the time, or else the first sample.
std::vector<ImuSample>::const_iterator SampleBefore(
    const std::vector<ImuSample>& samples, std::int64_t t_ns) {
  const auto first =
      std::lower_bound(samples.begin(), samples.end(), t_ns, Before);
  const bool at = first != samples.end() && first->t_ns == t_ns;
  return first == samples.begin() || at ? first : first - 1;
}

}  // namespace

struct SegmentBuilder::State {
  using Samples = std::vector<ImuSample>;

  SegmentBuilderOptions options;
  std::uint64_t max_gap_ns;
  std::uint64_t seconds_ns;
  std::int64_t padding_ns;
  std::int64_t next_index;
  Estimation estimation;
  bool healthy = true;
  ObservationFilter filter;
  // Keyframes of the current segment and, while IMU samples lag behind, of
  // later ones.
  std::vector<PendingKeyframe> keyframes;
  // Samples from padding_ns before the first keyframe on.
  std::vector<ImuSample> imu;
  // The same of the second IMU, if one was added.
  std::vector<ImuSample> imu1;
  bool has_second_imu = false;
  // Time of the last sample of the newest segment, and of the keyframe that
  // followed it when it was closed.
  std::optional<std::int64_t> reach_ns;
  std::optional<std::int64_t> successor_ns;
  std::optional<std::int64_t> last_keyframe_ns;
  std::optional<double> temperature_c;
  std::deque<ClosedSegment> closed;
  SegmentBuilderStatistics statistics;

  explicit State(const SegmentBuilderOptions& given)
      : options(given),
        max_gap_ns(static_cast<std::uint64_t>(Nanoseconds(given.max_gap_s))),
        seconds_ns(static_cast<std::uint64_t>(Nanoseconds(given.seconds))),
        padding_ns(Nanoseconds(given.padding_s)),
        next_index(given.first_index) {
    estimation.version = given.calibration_version;
    if (given.theta) SetTheta(*given.theta);
  }

  bool SetTheta(const Calibration& theta) {
    if (!Validate(theta, "").empty()) return false;
    estimation.theta = std::make_shared<const Calibration>(theta);
    return true;
  }

  void SetHealthy(bool now) {
    if (now == healthy) return;
    healthy = now;
    if (healthy) {
      filter.StartNewIds();
    } else {
      CloseWhatIs(/*padded=*/false);
      statistics.keyframes_unhealthy += keyframes.size();
      keyframes.clear();
    }
  }

  // Number of keyframes of the segment that starts with the first keyframe, if
  // the keyframe after the segment has arrived. 1 if that has another version.
  std::optional<std::size_t> ClosedSize() const {
    if (keyframes.empty()) return std::nullopt;
    for (std::size_t n = 1; n < keyframes.size(); ++n) {
      const bool same_version =
          keyframes[n].estimation.version == keyframes[0].estimation.version;
      if (!same_version || (n >= 2 && IsFull(n))) return n;
    }
    return std::nullopt;
  }

  // True if the first n keyframes make a segment, given the one after them.
  bool IsFull(std::size_t n) const {
    if (options.seconds > 0) {
      return Elapsed(keyframes[n].t_ns(), keyframes[0].t_ns()) >= seconds_ns;
    }
    return n >= static_cast<std::size_t>(std::max(options.keyframes, 2));
  }

  bool ImuReaches(std::int64_t t_ns) const {
    const auto reaches = [&](const std::vector<ImuSample>& samples) {
      return !samples.empty() && samples.back().t_ns >= t_ns;
    };
    return reaches(imu) && (!has_second_imu || reaches(imu1));
  }

  // True if the newest segment has samples up to the first keyframe, which did
  // not follow it directly: the daemon would join them, although tracking was
  // lost between them.
  bool SeemsToFollow() const {
    const std::int64_t first_ns = keyframes.front().t_ns();
    return reach_ns && *reach_ns >= first_ns && successor_ns != first_ns;
  }

  // Time to which samples are needed for a segment of the first n keyframes: it
  // is joined with the keyframe after it.
  std::int64_t EndOf(std::size_t n) const {
    const std::int64_t end_ns = keyframes[n - 1].end_ns();
    return n < keyframes.size() ? std::max(keyframes[n].t_ns(), end_ns)
                                : end_ns;
  }

  std::int64_t PaddedEndOf(std::size_t n) const {
    return std::max(EndOf(n), Later(keyframes[n - 1].end_ns(), padding_ns));
  }

  // Closes a segment of the first `size` keyframes, with samples up to
  // `end_ns`.
  void Close(std::size_t size, std::int64_t end_ns) {
    // Allocations come first: if one fails, nothing has changed.
    ClosedSegment segment;
    const std::int64_t index = next_index + (SeemsToFollow() ? 1 : 0);
    segment.key = {options.session, index};
    segment.calibration_version = keyframes.front().estimation.version;
    segment.min_observations = options.min_observations;
    segment.temperature_c = temperature_c;
    segment.session_start_ns = options.session_start_ns;
    segment.begin_ns = Earlier(keyframes.front().begin_ns(), padding_ns);
    segment.end_ns = end_ns;
    segment.theta = keyframes[size - 1].estimation.theta;
    segment.pixel_sigma_px = options.pixel_sigma_px;
    segment.gravity_mps2 = options.gravity_mps2;
    segment.keyframes.reserve(size);
    Samples next_imu, next_imu1;
    next_imu.reserve(imu.size() + imu.size() / 8);
    next_imu1.reserve(imu1.size() + imu1.size() / 8);
    closed.push_back(std::move(segment));

    const auto middle = keyframes.begin() + static_cast<std::ptrdiff_t>(size);
    for (auto it = keyframes.begin(); it != middle; ++it) {
      closed.back().keyframes.push_back(std::move(it->observed));
    }
    keyframes.erase(keyframes.begin(), middle);
    const std::int64_t next_begin_ns =
        keyframes.empty() ? end_ns
                          : std::min(end_ns, keyframes.front().begin_ns());
    const std::int64_t from_ns = Earlier(next_begin_ns, padding_ns);
    next_imu.assign(SampleBefore(imu, from_ns), imu.cend());
    next_imu1.assign(SampleBefore(imu1, from_ns), imu1.cend());
    closed.back().imu = std::exchange(imu, std::move(next_imu));
    closed.back().imu1 = std::exchange(imu1, std::move(next_imu1));
    const std::vector<ImuSample>& sent = closed.back().imu;
    const auto last =
        std::lower_bound(sent.begin(), sent.end(), end_ns, Before);
    reach_ns = last == sent.end() ? sent.back().t_ns : last->t_ns;
    successor_ns.reset();
    if (!keyframes.empty()) successor_ns = keyframes.front().t_ns();
    next_index = index + 1;
    ++statistics.segments;
  }

  // Drops keyframes before the first sample, which no later sample can cover.
  void DropUncovered() {
    const auto drop = [&](const Samples& samples) {
      if (samples.empty()) return;
      DropBefore(
          std::find_if(keyframes.begin(), keyframes.end(), [&](const auto& k) {
            return k.begin_ns() >= samples.front().t_ns;
          }));
    };
    drop(imu);
    drop(imu1);
  }

  void DropBefore(std::vector<PendingKeyframe>::iterator end) {
    statistics.keyframes_dropped +=
        static_cast<std::uint64_t>(end - keyframes.begin());
    keyframes.erase(keyframes.begin(), end);
  }

  // Closes the segments whose samples have arrived, with the padding or as far
  // as it has arrived.
  void CloseWhatIs(bool padded = true) {
    DropUncovered();
    while (const auto size = ClosedSize()) {
      if (*size < 2) {
        DropBefore(keyframes.begin() + 1);
        continue;
      }
      const std::int64_t end_ns = PaddedEndOf(*size);
      if (!ImuReaches(padded ? end_ns : EndOf(*size))) return;
      Close(*size, end_ns);
    }
  }

  void Flush(int min_keyframes) {
    CloseWhatIs(/*padded=*/false);
    std::size_t covered = keyframes.size();
    while (covered > 0 && !ImuReaches(keyframes[covered - 1].end_ns())) {
      --covered;
    }
    if (covered >= static_cast<std::size_t>(std::max(min_keyframes, 2))) {
      Close(covered, Later(keyframes[covered - 1].end_ns(), padding_ns));
    }
    DropBefore(keyframes.end());
  }

  // Adds it to `samples`: imu or imu1.
  bool AddSample(const ImuSample& sample, Samples* samples);
  bool AddKeyframe(const KeyframeState& state,
                   std::int64_t image_t_ns,
                   std::span<const KeyframeObservation> observations);
  // True if samples that have not arrived by this time will not arrive.
  bool IsStarved(std::int64_t t_ns) const;
  void GiveUp();
};

bool SegmentBuilder::State::AddSample(const ImuSample& sample,
                                      Samples* samples) {
  if (!samples->empty() && sample.t_ns <= samples->back().t_ns) {
    ++statistics.imu_ignored;
    return false;
  }
  samples->push_back(sample);
  CloseWhatIs();
  // A keyframe may lag by max_gap. A keyframe that lags more cannot continue
  // the current segment, so that older samples are not needed.
  if (!keyframes.empty() && sample.t_ns > keyframes.back().t_ns() &&
      Elapsed(sample.t_ns, keyframes.back().t_ns()) > 2 * max_gap_ns) {
    Flush(options.min_keyframes);
  }
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  if (keyframes.empty() && Elapsed(sample.t_ns, lowest) > max_gap_ns &&
      Elapsed(sample.t_ns, samples->front().t_ns) > 2 * max_gap_ns) {
    const auto oldest = sample.t_ns - static_cast<std::int64_t>(max_gap_ns);
    samples->erase(samples->cbegin(),
                   SampleBefore(*samples, Earlier(oldest, padding_ns)));
  }
  return true;
}

bool SegmentBuilder::State::IsStarved(std::int64_t t_ns) const {
  if (keyframes.empty()) return false;
  const std::int64_t first_ns = keyframes.front().t_ns();
  const auto reach = [&](const Samples& samples) {
    return samples.empty() ? first_ns : std::max(samples.back().t_ns, first_ns);
  };
  const std::int64_t since =
      has_second_imu ? std::min(reach(imu), reach(imu1)) : reach(imu);
  return t_ns > since && Elapsed(t_ns, since) > 2 * max_gap_ns;
}

bool SegmentBuilder::State::AddKeyframe(
    const KeyframeState& state,
    std::int64_t image_t_ns,
    std::span<const KeyframeObservation> observations) {
  if (!healthy) {
    ++statistics.keyframes_unhealthy;
    return false;
  }
  const bool is_later = !last_keyframe_ns || image_t_ns > *last_keyframe_ns;
  const std::uint64_t apart = Elapsed(std::max(state.t_ns, image_t_ns),
                                      std::min(state.t_ns, image_t_ns));
  if (!is_later || apart > kMaxStateOffset_ns) {
    ++statistics.keyframes_refused;
    return false;
  }
  const bool gap =
      last_keyframe_ns && Elapsed(image_t_ns, *last_keyframe_ns) > max_gap_ns;
  if ((gap && !keyframes.empty()) || IsStarved(image_t_ns)) {
    Flush(options.min_keyframes);
  }
  if (gap && options.new_ids_after_gap) filter.StartNewIds();
  PendingKeyframe added{{state,
                         filter.Filter(observations, estimation.theta.get()),
                         state.t_ns - image_t_ns},
                        estimation};
  added.observed.state.t_ns = image_t_ns;
  keyframes.push_back(std::move(added));
  if (!options.session_start_ns) options.session_start_ns = image_t_ns;
  last_keyframe_ns = image_t_ns;
  CloseWhatIs();
  return true;
}

// Frees everything that is held, after memory ran out.
void SegmentBuilder::State::GiveUp() {
  ++statistics.out_of_memory;
  statistics.keyframes_dropped += keyframes.size();
  std::vector<PendingKeyframe>().swap(keyframes);
  Samples().swap(imu);
  Samples().swap(imu1);
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
    return state_->AddSample(sample, &state_->imu);
  } catch (...) {
    state_->GiveUp();
    return false;
  }
}

bool SegmentBuilder::AddSecondImu(const ImuSample& sample) noexcept {
  if (state_ == nullptr) return false;
  try {
    state_->has_second_imu = true;
    return state_->AddSample(sample, &state_->imu1);
  } catch (...) {
    state_->GiveUp();
    return false;
  }
}

bool SegmentBuilder::AddKeyframe(
    const KeyframeState& state,
    std::span<const KeyframeObservation> observations) noexcept {
  return AddKeyframe(state, state.t_ns, observations);
}

bool SegmentBuilder::AddKeyframe(
    const KeyframeState& state,
    std::int64_t image_t_ns,
    std::span<const KeyframeObservation> observations) noexcept {
  if (state_ == nullptr) return false;
  try {
    return state_->AddKeyframe(state, image_t_ns, observations);
  } catch (...) {
    state_->GiveUp();
    return false;
  }
}

void SegmentBuilder::SetCalibrationVersion(std::int64_t version) noexcept {
  if (state_ != nullptr) state_->estimation.version = version;
}

bool SegmentBuilder::SetTheta(const Calibration& theta) noexcept {
  if (state_ == nullptr) return false;
  try {
    return state_->SetTheta(theta);
  } catch (...) {
    ++state_->statistics.out_of_memory;
    return false;
  }
}

void SegmentBuilder::SetHealthy(bool healthy) noexcept {
  if (state_ != nullptr) state_->SetHealthy(healthy);
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
      AssemblyStatistics counts;
      MotionSegment segment = Assemble(*closed, &counts);
      state_->statistics.tracks_triangulated += counts.tracks_triangulated;
      state_->statistics.tracks_dropped += counts.tracks_dropped;
      return segment;
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
  if (state_ == nullptr) return {};
  SegmentBuilderStatistics statistics = state_->statistics;
  statistics.observations_dropped = state_->filter.dropped();
  return statistics;
}

}  // namespace selfcal::client
