#include "core/calibration/problem.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <tuple>
#include <utility>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/map_sharing.h"
#include "core/calibration/track_depth.h"
#include "core/factor/inertial.h"
#include "core/factor/sampling.h"
#include "core/model/second_imu.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

// SamplesBetween; for the second IMU earlier and later by the largest time
// offset.
std::span<const ImuSample> SamplesOfLink(std::span<const ImuSample> samples,
                                         int imu,
                                         std::int64_t t0_ns,
                                         std::int64_t t1_ns) {
  const std::int64_t more_ns =
      imu == 0 ? 0 : std::llround(1e9 * kMaxSecondOffset_s);
  return SamplesBetween(samples, t0_ns - more_ns, t1_ns + more_ns);
}

void AddInertialLinks(const MotionSegment& segment,
                      int imu,
                      int first_keyframe,
                      std::vector<InertialLink>* links) {
  const std::span<const ImuSample> samples =
      imu == 0 ? SamplesFromFirstKeyframe(segment)
               : SecondSamplesFromFirstKeyframe(segment);
  for (std::size_t k = 1; k < segment.keyframes.size(); ++k) {
    const int after = first_keyframe + static_cast<int>(k);
    links->push_back({after - 1,
                      after,
                      SamplesOfLink(samples,
                                    imu,
                                    segment.keyframes[k - 1].t_ns,
                                    segment.keyframes[k].t_ns),
                      imu});
  }
}

// One track for each landmark of a partition, sorted by id, and the position of
// the landmark in the map of the SLAM system.
struct PartitionTracks {
  std::vector<Track> tracks;
  std::vector<Eigen::Vector3d> landmarks_G;
};

PartitionTracks CollectTracks(const std::vector<const MotionSegment*>& segments,
                              const std::vector<int>& partition,
                              const std::vector<int>& first_keyframe) {
  std::map<std::uint64_t, Track> by_id;
  std::map<std::uint64_t, Eigen::Vector3d> places_G;
  for (const int s : partition) {
    for (const Observation& seen : segments[s]->observations) {
      const std::uint64_t id = segments[s]->landmarks[seen.landmark].id;
      Track& track = by_id[id];
      track.id = id;
      track.observations.push_back(
          {first_keyframe[s] + seen.keyframe, seen.camera, seen.z_px});
      places_G[id] = segments[s]->landmarks[seen.landmark].p_G;
    }
  }
  PartitionTracks result;
  for (auto& [id, track] : by_id) {
    std::sort(track.observations.begin(),
              track.observations.end(),
              [](const TrackObservation& a, const TrackObservation& b) {
                return std::tie(a.keyframe, a.camera) <
                       std::tie(b.keyframe, b.camera);
              });
    result.tracks.push_back(std::move(track));
    result.landmarks_G.push_back(places_G[id]);
  }
  return result;
}

// The mean over the segments of each chain.
std::vector<double> ChainTemperatures(
    const Calibration& theta,
    const std::vector<const MotionSegment*>& segments,
    const std::vector<bool>& starts_chain) {
  std::vector<double> means_c;
  int count = 0;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (starts_chain[s]) {
      means_c.push_back(0);
      count = 0;
    }
    double& mean_c = means_c.back();
    mean_c += (TemperatureOf(theta, *segments[s]) - mean_c) / ++count;
  }
  return means_c;
}

// The chains that begin with segments of a partition.
std::vector<int> ChainsOf(const CalibrationProblem& problem,
                          const std::vector<int>& partition,
                          const std::vector<int>& first_keyframe) {
  const std::vector<int>& starts = problem.chain_starts;
  std::vector<int> chains;
  for (const int s : partition) {
    const auto at =
        std::lower_bound(starts.begin(), starts.end(), first_keyframe[s]);
    if (at != starts.end() && *at == first_keyframe[s]) {
      chains.push_back(static_cast<int>(at - starts.begin()));
    }
  }
  return chains;
}

}  // namespace

int PieceOf(const Track& track, int observation) {
  const auto next = std::upper_bound(
      track.later_pieces.begin(), track.later_pieces.end(), observation);
  return static_cast<int>(next - track.later_pieces.begin());
}

std::span<const ImuSample> SamplesBetween(std::span<const ImuSample> imu,
                                          std::int64_t t0_ns,
                                          std::int64_t t1_ns) {
  const auto earlier = [](const ImuSample& s, std::int64_t t_ns) {
    return s.t_ns < t_ns;
  };
  const auto first = std::lower_bound(imu.begin(), imu.end(), t0_ns, earlier);
  const auto last = std::lower_bound(first, imu.end(), t1_ns, earlier);
  const auto samples_before =
      std::min<std::ptrdiff_t>(kSamplesBeyond, first - imu.begin());
  const auto samples_after =
      std::min<std::ptrdiff_t>(kSamplesBeyond, imu.end() - last);
  const auto before =
      std::lower_bound(imu.begin(), first, t0_ns - kReachBeyond_ns, earlier);
  const auto after =
      std::lower_bound(last, imu.end(), t1_ns + kReachBeyond_ns, earlier);
  return {std::min(before, first - samples_before),
          std::max(after, last + samples_after)};
}

CalibrationProblem FlattenSegments(
    const Rig& rig,
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    const SharingLimits& limits) {
  CalibrationProblem problem;
  const int imus = ImuCount(rig.factory);
  std::vector<int> first_keyframe;
  std::vector<bool> starts_chain(segments.size(), true);
  for (const MotionSegment* segment : segments) {
    first_keyframe.push_back(static_cast<int>(problem.keyframes.size()));
    for (int imu = 0; imu < imus; ++imu) {
      AddInertialLinks(
          *segment, imu, first_keyframe.back(), &problem.inertial_links);
    }
    const SegmentTheta theta_s(rig.factory, *segment);
    const StartedSegment started(*theta_s, *segment);
    problem.keyframes.insert(problem.keyframes.end(),
                             (*started).keyframes.begin(),
                             (*started).keyframes.end());
    for (std::size_t k = 0; k < segment->keyframes.size(); ++k) {
      problem.contexts.push_back(ContextOf(*segment, k));
    }
  }
  for (const SegmentJoint& joint : partitioning.joints) {
    const int after = first_keyframe[joint.after];
    const MotionSegment& before = *segments[joint.before];
    for (int imu = 0; imu < imus; ++imu) {
      problem.inertial_links.push_back(
          {after - 1,
           after,
           SamplesOfLink(imu == 0 ? before.imu : before.imu1,
                         imu,
                         problem.keyframes[after - 1].t_ns,
                         problem.keyframes[after].t_ns),
           imu});
    }
    starts_chain[joint.after] = false;
  }
  for (const SegmentGap& gap : partitioning.gaps) {
    const int after = first_keyframe[gap.after];
    problem.bias_links.push_back(
        {after - 1, after, BiasWalkSigmas(rig.imu_noise, gap.dt_s)});
  }
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (starts_chain[s]) {
      problem.chain_starts.push_back(first_keyframe[s]);
    }
  }
  problem.chain_temperatures_c =
      ChainTemperatures(rig.factory, segments, starts_chain);
  for (const std::vector<int>& partition : partitioning.partitions) {
    PartitionTracks all = CollectTracks(segments, partition, first_keyframe);
    const std::vector<bool> with_depth =
        TracksWithDepth(rig, problem.keyframes, all.tracks, all.landmarks_G);
    SharedMap map = ShareMap(limits,
                             partitioning.merge_landmarks,
                             problem.chain_starts,
                             ChainsOf(problem, partition, first_keyframe),
                             std::move(all.tracks),
                             with_depth);
    for (const std::vector<int>& connected : map.connected) {
      problem.gauge_keyframes.push_back(
          problem.chain_starts[connected.front()]);
    }
    std::move(map.tracks.begin(),
              map.tracks.end(),
              std::back_inserter(problem.tracks));
  }
  return problem;
}

void MeasureMotions(const Rig& rig,
                    const Calibration& theta,
                    const CalibrationProblem& problem,
                    std::span<const KeyframeState> keyframes,
                    KeyframeMotions* motions) {
  const ChainThetas thetas(theta, problem);
  motions->Measure(
      rig,
      [&](std::size_t k) -> const Calibration& {
        return thetas.OfKeyframe(static_cast<int>(k));
      },
      EstimatedTimeOffsets(rig),
      keyframes,
      [&](std::size_t k) { return problem.contexts[k]; });
}

}  // namespace selfcal
