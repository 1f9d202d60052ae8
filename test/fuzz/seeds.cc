#include "test/fuzz/seeds.h"

#include "core/simulation/simulate.h"
#include "proto/convert.h"
#include "selfcal/vi_map/vi_map.pb.h"

namespace selfcal {
namespace {

SimulatedSession SmallSession() {
  SimulationOptions options;
  options.seed = 1;
  options.keyframes_per_segment = 4;
  options.landmarks_in_view = 6;
  const Rig rig = HandheldRig("fuzzed");
  return Simulate(rig,
                  rig.factory,
                  rig.factory,
                  *MakeHandheld(1, 1.0, 1),
                  "session",
                  options);
}

std::string SegmentSeed(const MotionSegment& segment) {
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/fuzzed");
  *request.mutable_segment() = ToProto(segment);
  return request.SerializeAsString();
}

void SetId(std::uint64_t value, vi_map::Id* id) {
  id->add_uint(value);
  id->add_uint(value);
}

template <typename Vector>
void Add(const Vector& values,
         google::protobuf::RepeatedField<double>* column) {
  for (int i = 0; i < values.size(); ++i) column->Add(values[i]);
}

// Keyframe k becomes vertex k + 1, which stores landmark k + 1.
void AddVertex(const MotionSegment& segment, int k, vi_map::ViMap* map) {
  const KeyframeState& state = segment.keyframes[k];
  SetId(k + 1, map->add_vertex_ids());
  vi_map::Vertex* vertex = map->add_vertices();
  Add(state.q_GI.coeffs(), vertex->mutable_t_m_i());
  Add(state.p_GI, vertex->mutable_t_m_i());
  Add(state.v_GI, vertex->mutable_v_m());
  Add(state.b_a, vertex->mutable_accel_bias());
  Add(state.b_g, vertex->mutable_gyro_bias());
  vi_map::VisualFrame* frame = vertex->mutable_n_visual_frame()->add_frames();
  SetId(100 + k, frame->mutable_id());
  frame->set_timestamp(state.t_ns);
  for (int landmark = 1; landmark <= 2; ++landmark) {
    Add(Eigen::Vector2d(100 + k, 200 + landmark),
        frame->mutable_keypoint_measurements());
    frame->add_keypoint_measurement_sigmas(0.8);
    SetId(landmark, frame->add_landmark_ids());
  }
  vi_map::Landmark* landmark =
      vertex->mutable_landmark_store()->add_landmarks();
  SetId(k + 1, landmark->mutable_id());
  Add(Eigen::Vector3d(0, 0, 3), landmark->mutable_position());
  landmark->set_quality(2);
}

void AddEdge(const MotionSegment& segment, int k, vi_map::ViMap* map) {
  SetId(k + 1, map->add_edge_ids());
  vi_map::ViwlsEdge* edge = map->add_edges()->mutable_viwls();
  SetId(k + 1, edge->mutable_from());
  SetId(k + 2, edge->mutable_to());
  for (const ImuSample& sample : segment.imu) {
    if (sample.t_ns < segment.keyframes[k].t_ns ||
        sample.t_ns > segment.keyframes[k + 1].t_ns) {
      continue;
    }
    edge->add_imu_timestamps(sample.t_ns);
    Add(sample.accel, edge->mutable_imu_data());
    Add(sample.gyro, edge->mutable_imu_data());
  }
}

std::string ViMapSeed(const MotionSegment& segment) {
  vi_map::ViMap map;
  SetId(9, map.add_mission_ids());
  SetId(1, map.add_missions()->mutable_root_vertex_id());
  const int keyframes = static_cast<int>(segment.keyframes.size());
  for (int k = 0; k < keyframes; ++k) AddVertex(segment, k, &map);
  for (int k = 0; k + 1 < keyframes; ++k) AddEdge(segment, k, &map);
  return map.SerializeAsString();
}

std::string ConfigText() {
  return R"(# A comment.
state-dir = "/var/lib/selfcal"
listen = ["unix:/run/selfcal/selfcald.sock", "insecure:127.0.0.1:7447"]
scoring-threads = 2
change-false-alarms = 1e-6
log-level = "info"
metrics = "off"
)";
}

}  // namespace

std::string FuzzSensorsText() {
  return R"(sensors:
  - sensor_type: NCAMERA
    cameras:
      - camera:
          image_height: 480
          image_width: 640
          intrinsics: {data: [255, 255, 318, 242]}
          distortion: {type: fisheye, parameters: {data: [0.92]}}
        T_B_C:
          data:
            - [1, 0, 0, 0]
            - [0, 1, 0, 0]
            - [0, 0, 1, 0]
            - [0, 0, 0, 1]
  - sensor_type: IMU
    sigmas:
      gyro_noise_density: 0.005
      gyro_bias_random_walk_noise_density: 4e-06
      acc_noise_density: 0.01
      acc_bias_random_walk_noise_density: 0.0002
    gravity_magnitude_mps2: 9.81
)";
}

std::vector<FuzzSeed> FuzzSeeds() {
  const SimulatedSession session = SmallSession();
  std::vector<FuzzSeed> seeds;
  for (std::size_t i = 0; i < session.segments.size(); ++i) {
    seeds.push_back({"segment",
                     "seed-" + std::to_string(i),
                     SegmentSeed(session.segments[i])});
  }
  seeds.push_back({"vi_map", "seed", ViMapSeed(session.segments[0])});
  seeds.push_back(
      {"rig", "seed", ToProto(HandheldRig("fuzzed")).SerializeAsString()});
  seeds.push_back({"sensors", "seed", FuzzSensorsText()});
  seeds.push_back({"config", "seed", ConfigText()});
  return seeds;
}

}  // namespace selfcal
