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

#include "client/selfcal/keyframe_intake.h"
#include "client/selfcal/keyframe_queue.h"
#include "client/selfcal/sample_queue.h"
#include "client/selfcal/saturated_times.h"
#include "client/selfcal/segment_numbering.h"

namespace selfcal::client {
namespace {

// Otherwise a container that grows would copy every observation.
static_assert(std::is_nothrow_move_constructible_v<ClosedSegment>);

std::int64_t Nanoseconds(double seconds) {
  constexpr double kMaxSeconds = 1e9;  // keeps the product inside int64
  return std::llround(std::clamp(seconds, 0.0, kMaxSeconds) * 1e9);
}

SegmentSize SizeOf(const SegmentBuilderOptions& options) {
  SegmentSize size{.keyframes = options.keyframes, .duration_ns = {}};
  if (options.seconds > 0) {
    size.duration_ns = static_cast<std::uint64_t>(Nanoseconds(options.seconds));
  }
  return size;
}

// Time of the first sample at or after `end_ns`, or else of the last sample.
std::int64_t ReachOf(const std::vector<ImuSample>& samples,
                     std::int64_t end_ns) {
  const auto first = std::lower_bound(
      samples.begin(), samples.end(), end_ns, [](const auto& sample, auto t) {
        return sample.t_ns < t;
      });
  return first == samples.end() ? samples.back().t_ns : first->t_ns;
}

}  // namespace

// Keyframes that the intake accepts wait in their queue, as the samples do in
// theirs, until both leave as a closed segment.
struct SegmentBuilder::State {
  SegmentBuilderOptions options;
  std::uint64_t max_gap_ns;
  std::int64_t padding_ns;
  KeyframeIntake intake;
  KeyframeQueue keyframes;
  // Samples from padding_ns before the first keyframe on.
  SampleQueue imu;
  std::optional<SampleQueue> imu1;  // second IMU, once a sample was added
  std::optional<double> temperature_c;
  SegmentNumbering numbering;
  std::deque<ClosedSegment> closed;
  SegmentBuilderStatistics statistics;

  explicit State(const SegmentBuilderOptions& given)
      : options(given),
        max_gap_ns(static_cast<std::uint64_t>(Nanoseconds(given.max_gap_s))),
        padding_ns(Nanoseconds(given.padding_s)),
        intake(given.calibration_version),
        keyframes(SizeOf(given)),
        numbering(given.first_index) {
    if (given.theta) intake.SetTheta(*given.theta);
  }

  // Adds it to `samples`: imu or imu1.
  bool AddSample(const ImuSample& sample, SampleQueue* samples);
  bool AddKeyframe(const KeyframeState& state,
                   std::int64_t image_t_ns,
                   std::span<const KeyframeObservation> observations);
  void SetHealthy(bool healthy);
  void Flush(int min_keyframes);
  // Frees everything that is held, after memory ran out.
  void GiveUp();

  bool ImuReaches(std::int64_t t_ns) const;
  // True if samples that have not arrived by this time will not arrive.
  bool IsStarved(std::int64_t t_ns) const;
  // Drops keyframes before the first sample, which no later sample can cover.
  void DropUncovered();
  // Closes the segments whose samples have arrived, with the padding or as far
  // as it has arrived.
  void CloseWhatIs(bool padded = true);
  // Closes a segment of the first `size` keyframes, with samples up to
  // `end_ns`.
  void Close(std::size_t size, std::int64_t end_ns);
};

bool SegmentBuilder::State::AddSample(const ImuSample& sample,
                                      SampleQueue* samples) {
  if (!samples->Add(sample)) {
    ++statistics.imu_ignored;
    return false;
  }
  CloseWhatIs();
  // A keyframe may lag by max_gap. A keyframe that lags more cannot continue
  // the current segment, so that older samples are not needed.
  if (!keyframes.empty() && sample.t_ns > keyframes.back().t_ns() &&
      Elapsed(sample.t_ns, keyframes.back().t_ns()) > 2 * max_gap_ns) {
    Flush(options.min_keyframes);
  }
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  if (keyframes.empty() && Elapsed(sample.t_ns, lowest) > max_gap_ns &&
      Elapsed(sample.t_ns, samples->begin_ns()) > 2 * max_gap_ns) {
    const auto oldest = sample.t_ns - static_cast<std::int64_t>(max_gap_ns);
    samples->DropBefore(Earlier(oldest, padding_ns));
  }
  return true;
}

bool SegmentBuilder::State::AddKeyframe(
    const KeyframeState& state,
    std::int64_t image_t_ns,
    std::span<const KeyframeObservation> observations) {
  if (!intake.healthy()) {
    ++statistics.keyframes_unhealthy;
    return false;
  }
  if (!intake.IsInOrder(state.t_ns, image_t_ns)) {
    ++statistics.keyframes_refused;
    return false;
  }
  const bool gap = intake.IsAfterGap(image_t_ns, max_gap_ns);
  if ((gap && !keyframes.empty()) || IsStarved(image_t_ns)) {
    Flush(options.min_keyframes);
  }
  if (gap && options.new_ids_after_gap) intake.StartNewIds();
  keyframes.Add(intake.Read(state, image_t_ns, observations));
  if (!options.session_start_ns) options.session_start_ns = image_t_ns;
  intake.SetAccepted(image_t_ns);
  CloseWhatIs();
  return true;
}

void SegmentBuilder::State::SetHealthy(bool healthy) {
  if (!intake.SetHealthy(healthy) || healthy) return;
  CloseWhatIs(/*padded=*/false);
  statistics.keyframes_unhealthy += keyframes.DropAll();
}

void SegmentBuilder::State::Flush(int min_keyframes) {
  CloseWhatIs(/*padded=*/false);
  std::size_t covered = keyframes.size();
  while (covered > 0 && !ImuReaches(keyframes[covered - 1].end_ns())) {
    --covered;
  }
  if (covered >= static_cast<std::size_t>(std::max(min_keyframes, 2))) {
    Close(covered, Later(keyframes[covered - 1].end_ns(), padding_ns));
  }
  statistics.keyframes_dropped += keyframes.DropAll();
}

void SegmentBuilder::State::GiveUp() {
  ++statistics.out_of_memory;
  statistics.keyframes_dropped += keyframes.Free();
  imu.Free();
  if (imu1) imu1->Free();
}

bool SegmentBuilder::State::ImuReaches(std::int64_t t_ns) const {
  return imu.Reaches(t_ns) && (!imu1 || imu1->Reaches(t_ns));
}

bool SegmentBuilder::State::IsStarved(std::int64_t t_ns) const {
  if (keyframes.empty()) return false;
  const std::int64_t first_ns = keyframes.front().t_ns();
  const auto reach = [&](const SampleQueue& samples) {
    return samples.empty() ? first_ns : std::max(samples.end_ns(), first_ns);
  };
  const std::int64_t since =
      imu1 ? std::min(reach(imu), reach(*imu1)) : reach(imu);
  return t_ns > since && Elapsed(t_ns, since) > 2 * max_gap_ns;
}

void SegmentBuilder::State::DropUncovered() {
  const auto drop = [&](const SampleQueue& samples) {
    if (samples.empty()) return;
    statistics.keyframes_dropped += keyframes.DropBefore(samples.begin_ns());
  };
  drop(imu);
  if (imu1) drop(*imu1);
}

void SegmentBuilder::State::CloseWhatIs(bool padded) {
  DropUncovered();
  while (const auto size = keyframes.ClosedSize()) {
    if (*size < 2) {
      statistics.keyframes_dropped += keyframes.DropFirst(1);
      continue;
    }
    const std::int64_t needed_ns = keyframes.EndOf(*size);
    const std::int64_t end_ns =
        std::max(needed_ns, Later(keyframes[*size - 1].end_ns(), padding_ns));
    if (!ImuReaches(padded ? end_ns : needed_ns)) return;
    Close(*size, end_ns);
  }
}

void SegmentBuilder::State::Close(std::size_t size, std::int64_t end_ns) {
  // Allocations come first: if one fails, nothing has changed.
  ClosedSegment segment;
  const std::int64_t index = numbering.IndexFrom(keyframes.front().t_ns());
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
  std::vector<ImuSample> next_imu = imu.Reserve();
  std::vector<ImuSample> next_imu1;
  if (imu1) next_imu1 = imu1->Reserve();
  closed.push_back(std::move(segment));

  ClosedSegment& added = closed.back();
  keyframes.Release(size, &added.keyframes);
  const std::int64_t next_begin_ns =
      keyframes.empty() ? end_ns
                        : std::min(end_ns, keyframes.front().begin_ns());
  const std::int64_t from_ns = Earlier(next_begin_ns, padding_ns);
  added.imu = imu.Release(from_ns, std::move(next_imu));
  if (imu1) added.imu1 = imu1->Release(from_ns, std::move(next_imu1));
  std::optional<std::int64_t> successor_ns;
  if (!keyframes.empty()) successor_ns = keyframes.front().t_ns();
  numbering.Add(index, ReachOf(added.imu, end_ns), successor_ns);
  ++statistics.segments;
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
    if (!state_->imu1) state_->imu1.emplace();
    return state_->AddSample(sample, &*state_->imu1);
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
  if (state_ != nullptr) state_->intake.SetCalibrationVersion(version);
}

bool SegmentBuilder::SetTheta(const Calibration& theta) noexcept {
  if (state_ == nullptr) return false;
  try {
    return state_->intake.SetTheta(theta);
  } catch (...) {
    ++state_->statistics.out_of_memory;
    return false;
  }
}

void SegmentBuilder::SetHealthy(bool healthy) noexcept {
  if (state_ == nullptr) return;
  try {
    state_->SetHealthy(healthy);
  } catch (...) {
    state_->GiveUp();
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
  return state_ == nullptr ? 0 : state_->numbering.next();
}

SegmentBuilderStatistics SegmentBuilder::statistics() const noexcept {
  if (state_ == nullptr) return {};
  SegmentBuilderStatistics statistics = state_->statistics;
  statistics.observations_dropped = state_->intake.observations_dropped();
  return statistics;
}

}  // namespace selfcal::client
