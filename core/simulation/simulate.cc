#include "core/simulation/simulate.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/model/temperature.h"
#include "core/simulation/exposures.h"
#include "core/simulation/feature_tracks.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/random.h"
#include "core/simulation/slam_landmarks.h"
#include "core/simulation/slam_states.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Keyframes fall between IMU samples, at slightly irregular times.
constexpr double kKeyframeOffset_s = 1.7e-3;
constexpr double kKeyframeJitter_s = 0.4e-3;

std::vector<KeyframeState> TrueKeyframes(const Trajectory& trajectory,
                                         const ImuReadings& imu,
                                         const ImuReadings& imu1,
                                         const TimeMargins& margins,
                                         const SimulationOptions& options) {
  Random random(options.seed, kKeyframeTimeStream);
  std::vector<KeyframeState> keyframes;
  if (imu.measured.empty()) return keyframes;
  const std::int64_t end_ns = imu.measured.back().t_ns;
  const std::int64_t end1_ns =
      imu1.measured.empty() ? end_ns : imu1.measured.back().t_ns;
  for (int k = 0;; ++k) {
    const double t_s = k / options.keyframe_rate_hz + kKeyframeOffset_s +
                       random.Uniform(-kKeyframeJitter_s, kKeyframeJitter_s) +
                       margins.before_s;
    const std::int64_t t_ns = std::llround(t_s * 1e9);
    const std::int64_t last_ns = t_ns + std::llround(margins.after_s * 1e9);
    if (last_ns > end_ns || t_ns > end1_ns) return keyframes;
    keyframes.push_back(TrueState(trajectory, imu, t_ns));
  }
}

// The whole simulated session, before it is cut into segments.
struct Recording {
  ImuReadings imu;
  ImuReadings imu1;  // empty without a second one
  std::vector<KeyframeState> truth;
  std::vector<KeyframeState> slam;
  FeatureTracks tracks;
  std::vector<std::optional<Eigen::Vector3d>> slam_landmarks_G;
};

// Cuts one segment after the other; begin and end are keyframes of the session.
class Cutter {
 public:
  Cutter(const Recording& recording, const SimulationOptions& options)
      : recording_(recording),
        options_(options),
        lost_samples_(options.seed, kLostSampleStream),
        second_lost_samples_(options.seed, kSecondLostSampleStream),
        local_(recording.tracks.landmarks_G.size(), kUnseen) {}

  // Must be called for consecutive segments; end > begin. The IMU samples
  // extend to the keyframe `imu_end`.
  void Cut(int begin,
           int end,
           int imu_end,
           MotionSegment* segment,
           MotionSegment* truth) {
    CutStates(begin, end, imu_end, segment, truth);
    const std::vector<FeatureObservation>& all = recording_.tracks.observations;
    const std::size_t first = next_observation_;
    while (next_observation_ < all.size() &&
           all[next_observation_].keyframe < end) {
      ++next_observation_;
    }
    CountObservations(first);
    for (std::size_t i = first; i < next_observation_; ++i) {
      AddObservation(all[i], begin, segment, truth);
    }
    for (std::size_t i = first; i < next_observation_; ++i) {
      local_[all[i].landmark] = kUnseen;
    }
  }

 private:
  // Index of a landmark in the current segment, or kUnseen - n with the number
  // n of observations so far.
  static constexpr int kUnseen = -1;

  void CutStates(int begin,
                 int end,
                 int imu_end,
                 MotionSegment* segment,
                 MotionSegment* truth) {
    segment->keyframes.assign(recording_.slam.begin() + begin,
                              recording_.slam.begin() + end);
    truth->keyframes.assign(recording_.truth.begin() + begin,
                            recording_.truth.begin() + end);
    CutSamples(recording_.imu,
               begin,
               end,
               imu_end,
               &lost_samples_,
               &segment->imu,
               &truth->imu);
    if (recording_.imu1.measured.empty()) return;
    CutSamples(recording_.imu1,
               begin,
               end,
               imu_end,
               &second_lost_samples_,
               &segment->imu1,
               &truth->imu1);
  }

  void CutSamples(const ImuReadings& readings,
                  int begin,
                  int end,
                  int imu_end,
                  Random* lost_samples,
                  std::vector<ImuSample>* measured,
                  std::vector<ImuSample>* noise_free) const {
    const std::vector<ImuSample>& imu = readings.measured;
    const auto add = [&](std::size_t i) {
      measured->push_back(imu[i]);
      noise_free->push_back(readings.noise_free[i]);
    };
    const std::int64_t begin_ns = recording_.truth[begin].t_ns;
    const std::size_t from = SampleBefore(imu, begin_ns);
    const std::int64_t to_ns = recording_.truth[imu_end].t_ns;
    std::size_t to = SampleBefore(imu, to_ns);
    if (imu[to].t_ns < to_ns) ++to;
    const auto padding_ns =
        static_cast<std::int64_t>(std::llround(options_.imu_padding_s * 1e9));
    const std::int64_t padded_ns =
        std::max(begin_ns - padding_ns, imu.front().t_ns);
    for (std::size_t i = SampleBefore(imu, padded_ns); i < from; ++i) add(i);
    for (const std::size_t i :
         SamplesThatArrive(imu, from, to, options_, lost_samples)) {
      add(i);
    }
    const std::int64_t last_ns = recording_.truth[end - 1].t_ns + padding_ns;
    for (std::size_t i = to; i + 1 < imu.size() && imu[i].t_ns < last_ns; ++i) {
      add(i + 1);
    }
  }

  void CountObservations(std::size_t first) {
    for (std::size_t i = first; i < next_observation_; ++i) {
      --local_[recording_.tracks.observations[i].landmark];
    }
  }

  void AddObservation(const FeatureObservation& observation,
                      int begin,
                      MotionSegment* segment,
                      MotionSegment* truth) {
    const int m = observation.landmark;
    const std::optional<Eigen::Vector3d>& p_G = recording_.slam_landmarks_G[m];
    if (!p_G) return;
    int& local = local_[m];
    if (local < 0) {
      if (kUnseen - local < kMinSegmentObservations) return;
      local = static_cast<int>(segment->landmarks.size());
      const auto id = static_cast<std::uint64_t>(m) + 1;
      segment->landmarks.push_back({id, *p_G});
      truth->landmarks.push_back({id, recording_.tracks.landmarks_G[m]});
    }
    const int k = observation.keyframe - begin;
    segment->observations.push_back(
        {k, observation.camera, local, observation.measured_px});
    truth->observations.push_back(
        {k, observation.camera, local, observation.true_px});
  }

  const Recording& recording_;
  const SimulationOptions& options_;
  Random lost_samples_, second_lost_samples_;
  std::vector<int> local_;
  std::size_t next_observation_ = 0;
};

// The calibration by which shutters close when those of theta_true open.
Calibration ShutterClosed(const Calibration& theta_true,
                          const SimulationOptions& options) {
  Calibration later = theta_true;
  for (CameraCalibration& camera : later.cameras) {
    camera.time_offset_s += options.exposure_s;
  }
  return later;
}

}  // namespace

SimulatedSession Simulate(const Rig& rig,
                          const Calibration& device_true,
                          const Calibration& device_slam,
                          const Trajectory& trajectory,
                          const std::string& session,
                          const SimulationOptions& options) {
  const double temperature_c =
      options.temperature_c.value_or(device_true.reference_temperature_c);
  const Calibration theta_true = AtTemperature(device_true, temperature_c);
  const Calibration theta_slam = AtTemperature(device_slam, temperature_c);
  Recording recording;
  recording.imu = SimulateImu(rig, theta_true.imu, trajectory, options);
  TimeMargins margins = ExposureMargins(
      theta_true, theta_slam, options.session_age_s, trajectory.duration_s());
  margins.after_s += options.exposure_s;
  if (theta_true.imu1) {
    recording.imu1 =
        SimulateSecondImu(rig, *theta_true.imu1, trajectory, options);
  }
  recording.truth = TrueKeyframes(
      trajectory, recording.imu, recording.imu1, margins, options);
  const int N = options.keyframes_per_segment;
  const int segments = static_cast<int>(recording.truth.size()) / N;
  recording.truth.resize(static_cast<std::size_t>(segments) * N);
  const std::vector<double> session_s =
      SessionTimes(recording.truth, options.session_age_s);
  const auto exposures = [&](const Calibration& theta) {
    return TrueExposures(
        theta, recording.truth, session_s, trajectory, recording.imu);
  };
  recording.tracks =
      SimulateTracks(theta_true,
                     rig.pixel_sigma_px,
                     segments * N,
                     exposures(theta_true),
                     options,
                     exposures(ShutterClosed(theta_true, options)));
  std::vector<double> delays_s;
  for (const double s : session_s) {
    delays_s.push_back(KeyframeDelay(theta_true, theta_slam, s));
  }
  const std::vector<KeyframeState> meant =
      StatesLater(recording.truth, trajectory, recording.imu, delays_s);
  recording.slam =
      SlamStates(meant, recording.imu, theta_true.imu, theta_slam.imu, options);
  if (theta_true.imu1) {
    for (KeyframeState& x : recording.truth) {
      AddSecondMotion(trajectory, *theta_true.imu1, recording.imu1, &x);
    }
  }
  recording.slam_landmarks_G =
      TriangulateLandmarks(theta_slam,
                           SlamExposures(theta_slam,
                                         recording.slam,
                                         meant,
                                         session_s,
                                         delays_s,
                                         trajectory,
                                         recording.imu),
                           recording.tracks,
                           rig.pixel_sigma_px,
                           options);
  SimulatedSession result;
  Cutter cutter(recording, options);
  for (int s = 0; s < segments; ++s) {
    MotionSegment segment;
    segment.key = {session, s};
    segment.temperature_c = options.temperature_c;
    segment.session_start_ns = std::llround(-1e9 * options.session_age_s);
    MotionSegment truth = segment;
    const int end = (s + 1) * N;
    const int imu_end = s + 1 < segments ? end : end - 1;
    cutter.Cut(s * N, end, imu_end, &segment, &truth);
    result.segments.push_back(std::move(segment));
    result.truth.push_back(std::move(truth));
  }
  return result;
}

}  // namespace selfcal
