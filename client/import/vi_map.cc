#include "client/import/vi_map.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <system_error>
#include <unordered_map>
#include <utility>

#include "client/formats/format.h"
#include "client/import/read_file.h"
#include "client/import/vi_map_files.h"
#include "core/model/median.h"

namespace selfcal::client {
namespace {

using IdKey = std::pair<std::uint64_t, std::uint64_t>;

IdKey Key(const vi_map::Id& id) {
  if (id.uint_size() != 2) return {0, 0};
  return {id.uint(0), id.uint(1)};
}

bool IsValid(const IdKey& key) { return key != IdKey{0, 0}; }

absl::Status Bad(const std::string& folder, const std::string& what) {
  return absl::InvalidArgumentError(fmt::format("{}: {}", folder, what));
}

template <typename Column>
Eigen::Vector3d ToVector(const Column& column, int offset = 0) {
  return {column[offset], column[offset + 1], column[offset + 2]};
}

// Reads one folder into a recording. `landmark_ids` assigns the next free
// number to each landmark of this map.
class MapReader {
 public:
  MapReader(const std::string& folder,
            const ViMapOptions& options,
            std::uint64_t first_landmark_id)
      : folder_(folder),
        options_(options),
        next_landmark_id_(first_landmark_id) {}

  absl::StatusOr<ViMapRecording> Read() {
    absl::StatusOr<vi_map::ViMap> map = ReadViMapFiles(folder_);
    if (!map.ok()) return map.status();
    map_ = *std::move(map);
    const std::string sensors = folder_ + "/vi_map/sensors.yaml";
    absl::StatusOr<std::string> yaml = ReadFile(sensors);
    if (!yaml.ok()) return yaml.status();
    absl::StatusOr<ImportedRig> rig =
        ImportRig("maplab", {{sensors, *yaml}}, {});
    if (!rig.ok()) return rig.status();
    recording_.rig = std::move(rig->rig);
    for (auto step : {&MapReader::IndexVertices,
                      &MapReader::ReadLandmarks,
                      &MapReader::WalkChain}) {
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
    }
    if (!sigmas_px_.empty()) {
      recording_.rig.pixel_sigma_px = UpperMedian(sigmas_px_);
    }
    return std::move(recording_);
  }

  std::uint64_t next_landmark_id() const { return next_landmark_id_; }

 private:
  struct MapLandmark {
    Eigen::Vector3d p_M;
    std::uint64_t id;
  };

  absl::Status IndexVertices() {
    if (map_.missions_size() != 1 || map_.mission_ids_size() != 1) {
      return Bad(folder_,
                 fmt::format("contains {} missions; a map must have one",
                             map_.missions_size()));
    }
    if (map_.vertex_ids_size() != map_.vertices_size()) {
      return Bad(folder_, "vertex_ids and vertices differ in length");
    }
    const IdKey mission = Key(map_.mission_ids(0));
    recording_.session =
        fmt::format("{:016x}{:016x}", mission.first, mission.second);
    for (int i = 0; i < map_.vertices_size(); ++i) {
      if (absl::Status status = CheckVertex(i); !status.ok()) return status;
      vertex_index_[Key(map_.vertex_ids(i))] = i;
    }
    for (const vi_map::Edge& edge : map_.edges()) {
      if (!edge.has_viwls()) continue;
      if (!edge_from_.emplace(Key(edge.viwls().from()), &edge.viwls()).second) {
        return Bad(folder_, "two edges leave one vertex; expected one chain");
      }
    }
    return absl::OkStatus();
  }

  absl::Status CheckVertex(int i) const {
    const vi_map::Vertex& vertex = map_.vertices(i);
    const auto bad = [&](const char* field, int size) {
      return Bad(
          folder_,
          fmt::format("vertices[{}].{}: needs {} numbers", i, field, size));
    };
    if (vertex.t_m_i_size() != 7) return bad("T_M_I", 7);
    if (vertex.v_m_size() != 3) return bad("v_M", 3);
    if (vertex.accel_bias_size() != 3) return bad("accel_bias", 3);
    if (vertex.gyro_bias_size() != 3) return bad("gyro_bias", 3);
    const double norm = Rotation(vertex).norm();
    if (!(std::abs(norm - 1) < 1e-3)) {
      return Bad(
          folder_,
          fmt::format("vertices[{}].T_M_I: quaternion norm is {}", i, norm));
    }
    return absl::OkStatus();
  }

  static Eigen::Quaterniond Rotation(const vi_map::Vertex& vertex) {
    return {vertex.t_m_i(3), vertex.t_m_i(0), vertex.t_m_i(1), vertex.t_m_i(2)};
  }

  absl::Status ReadLandmarks() {
    for (int i = 0; i < map_.vertices_size(); ++i) {
      const vi_map::Vertex& vertex = map_.vertices(i);
      const Eigen::Quaterniond q_MI = Rotation(vertex).normalized();
      const Eigen::Vector3d p_MI = ToVector(vertex.t_m_i(), 4);
      for (const vi_map::Landmark& landmark :
           vertex.landmark_store().landmarks()) {
        if (landmark.position_size() != 3) {
          return Bad(folder_,
                     fmt::format("vertices[{}]: a landmark's position needs 3 "
                                 "numbers",
                                 i));
        }
        if (options_.good_landmarks_only && landmark.quality() != 2) continue;
        landmarks_[Key(landmark.id())] = {
            q_MI * ToVector(landmark.position()) + p_MI, 0};
      }
    }
    return absl::OkStatus();
  }

  absl::Status WalkChain() {
    IdKey key = Key(map_.missions(0).root_vertex_id());
    for (int step = 0; step < map_.vertices_size(); ++step) {
      const auto vertex = vertex_index_.find(key);
      if (vertex == vertex_index_.end()) {
        return Bad(folder_, "the chain of edges leads to an unknown vertex");
      }
      if (absl::Status status = AppendKeyframe(vertex->second); !status.ok()) {
        return status;
      }
      const auto edge = edge_from_.find(key);
      if (edge == edge_from_.end()) break;
      if (absl::Status status = AppendImu(*edge->second); !status.ok()) {
        return status;
      }
      key = Key(edge->second->to());
    }
    if (static_cast<int>(recording_.keyframes.size()) != map_.vertices_size()) {
      return Bad(
          folder_,
          fmt::format("the chain from the root reaches {} of {} vertices",
                      recording_.keyframes.size(),
                      map_.vertices_size()));
    }
    return absl::OkStatus();
  }

  absl::Status AppendKeyframe(int i) {
    const vi_map::Vertex& vertex = map_.vertices(i);
    const auto& frames = vertex.n_visual_frame().frames();
    if (frames.empty()) {
      return Bad(folder_, fmt::format("vertices[{}]: has no frame", i));
    }
    ViMapKeyframe keyframe;
    KeyframeState& state = keyframe.state;
    state.t_ns = frames[0].timestamp();
    state.q_GI = Rotation(vertex).normalized();
    state.p_GI = ToVector(vertex.t_m_i(), 4);
    state.v_GI = ToVector(vertex.v_m());
    state.b_a = ToVector(vertex.accel_bias());
    state.b_g = ToVector(vertex.gyro_bias());
    for (int camera = 0; camera < frames.size(); ++camera) {
      if (absl::Status status =
              AppendObservations(frames[camera], camera, i, &keyframe);
          !status.ok()) {
        return status;
      }
    }
    recording_.keyframes.push_back(std::move(keyframe));
    return absl::OkStatus();
  }

  absl::Status AppendObservations(const vi_map::VisualFrame& frame,
                                  int camera,
                                  int vertex,
                                  ViMapKeyframe* keyframe) {
    if (!IsValid(Key(frame.id())) ||
        (frame.has_is_valid() && !frame.is_valid()))
      return absl::OkStatus();
    const int n = frame.landmark_ids_size();
    if (frame.keypoint_measurements_size() != 2 * n ||
        camera >= static_cast<int>(recording_.rig.factory.cameras.size())) {
      return Bad(folder_,
                 fmt::format("vertices[{}].frames[{}]: keypoints, landmark ids "
                             "and cameras are inconsistent",
                             vertex,
                             camera));
    }
    const CameraCalibration& model = recording_.rig.factory.cameras[camera];
    for (int k = 0; k < n; ++k) {
      const auto landmark = landmarks_.find(Key(frame.landmark_ids(k)));
      if (landmark == landmarks_.end()) continue;
      const Eigen::Vector2d z_px(frame.keypoint_measurements(2 * k),
                                 frame.keypoint_measurements(2 * k + 1));
      // A tracker may follow a point beyond the border of the image; such
      // observations are dropped.
      if (!(z_px.minCoeff() >= 0 && z_px.x() <= model.width_px &&
            z_px.y() <= model.height_px)) {
        continue;
      }
      if (landmark->second.id == 0) landmark->second.id = next_landmark_id_++;
      if (frame.keypoint_measurement_sigmas_size() == n) {
        const double sigma_px = frame.keypoint_measurement_sigmas(k);
        if (!(sigma_px > 0 && std::isfinite(sigma_px))) {
          return Bad(folder_,
                     fmt::format("vertices[{}].frames[{}]: the sigma of "
                                 "keypoint {} is {}, not positive",
                                 vertex,
                                 camera,
                                 k,
                                 sigma_px));
        }
        sigmas_px_.push_back(sigma_px);
      }
      keyframe->observations.push_back(
          {camera, landmark->second.id, z_px, landmark->second.p_M});
    }
    return absl::OkStatus();
  }

  absl::Status AppendImu(const vi_map::ViwlsEdge& edge) {
    if (edge.imu_data_size() != 6 * edge.imu_timestamps_size()) {
      return Bad(folder_, "an edge's imu_data needs 6 numbers for each time");
    }
    std::vector<ImuSample>& imu = recording_.imu;
    for (int k = 0; k < edge.imu_timestamps_size(); ++k) {
      // The last sample of an edge is repeated as the first of the next.
      if (!imu.empty() && edge.imu_timestamps(k) <= imu.back().t_ns) continue;
      imu.push_back({edge.imu_timestamps(k),
                     ToVector(edge.imu_data(), 6 * k + 3),
                     ToVector(edge.imu_data(), 6 * k)});
    }
    return absl::OkStatus();
  }

  const std::string folder_;
  const ViMapOptions options_;
  std::uint64_t next_landmark_id_;
  vi_map::ViMap map_;
  ViMapRecording recording_;
  std::vector<double> sigmas_px_;  // of the used observations
  std::map<IdKey, int> vertex_index_;
  std::map<IdKey, const vi_map::ViwlsEdge*> edge_from_;
  std::map<IdKey, MapLandmark> landmarks_;
};

// Appends a recording, which must start with the keyframe at which the one
// before ends. The two are merged into one keyframe with the observations of
// both.
absl::Status Join(const std::string& folder,
                  ViMapRecording next,
                  ViMapRecording* first) {
  ViMapKeyframe& last = first->keyframes.back();
  if (next.keyframes.front().state.t_ns != last.state.t_ns) {
    return Bad(folder,
               fmt::format("does not continue the previous map: starts at {} "
                           "ns, but the previous map ends at {} ns",
                           next.keyframes.front().state.t_ns,
                           last.state.t_ns));
  }
  const auto& shared = next.keyframes.front().observations;
  last.observations.insert(
      last.observations.end(), shared.begin(), shared.end());
  std::move(next.keyframes.begin() + 1,
            next.keyframes.end(),
            std::back_inserter(first->keyframes));
  for (const ImuSample& sample : next.imu) {
    if (sample.t_ns > first->imu.back().t_ns) first->imu.push_back(sample);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ViMapRecording> ReadViMaps(
    const std::vector<std::string>& folders, const ViMapOptions& options) {
  if (folders.empty()) {
    return absl::InvalidArgumentError("no VI-map folder was given");
  }
  ViMapRecording result;
  std::uint64_t next_landmark_id = 1;
  for (std::size_t i = 0; i < folders.size(); ++i) {
    MapReader reader(folders[i], options, next_landmark_id);
    absl::StatusOr<ViMapRecording> recording = reader.Read();
    if (!recording.ok()) return recording.status();
    if (recording->keyframes.empty() || recording->imu.empty()) {
      return Bad(folders[i], "has no keyframes with IMU data");
    }
    next_landmark_id = reader.next_landmark_id();
    if (i == 0) {
      result = *std::move(recording);
    } else if (absl::Status status =
                   Join(folders[i], *std::move(recording), &result);
               !status.ok()) {
      return status;
    }
  }
  return result;
}

bool IsViMap(const std::string& folder) {
  std::error_code error;
  const std::filesystem::path path(folder);
  return std::filesystem::exists(path / "vi_map_metadata", error) ||
         std::filesystem::is_directory(path / "vi_map", error) ||
         std::filesystem::is_directory(path / "submap_0" / "vi_map", error);
}

absl::StatusOr<ViMapRecording> ReadViMap(const std::string& folder,
                                         const ViMapOptions& options) {
  std::vector<std::string> folders;
  for (int k = 0;; ++k) {
    const std::string submap = fmt::format("{}/submap_{}", folder, k);
    if (!std::filesystem::is_directory(submap)) break;
    folders.push_back(submap);
  }
  if (folders.empty()) folders.push_back(folder);
  return ReadViMaps(folders, options);
}

std::vector<MotionSegment> BuildSegments(const ViMapRecording& recording,
                                         const SegmentBuilderOptions& given) {
  // The map recognises landmarks after a gap.
  SegmentBuilderOptions options = given;
  options.new_ids_after_gap = false;
  SegmentBuilder builder(options);
  std::vector<MotionSegment> segments;
  const auto take = [&] {
    while (auto segment = builder.Take()) {
      segments.push_back(*std::move(segment));
    }
  };
  std::size_t sample = 0;
  for (const ViMapKeyframe& keyframe : recording.keyframes) {
    while (sample < recording.imu.size() &&
           recording.imu[sample].t_ns <= keyframe.state.t_ns) {
      builder.AddImu(recording.imu[sample++]);
    }
    builder.AddKeyframe(keyframe.state, keyframe.observations);
    take();
  }
  while (sample < recording.imu.size()) {
    builder.AddImu(recording.imu[sample++]);
  }
  builder.Flush(options.seconds > 0 ? options.min_keyframes
                                    : options.keyframes);
  take();
  return segments;
}

}  // namespace selfcal::client
