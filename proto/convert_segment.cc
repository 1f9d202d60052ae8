#include <google/protobuf/repeated_field.h>

#include <utility>

#include "proto/convert.h"

namespace selfcal {
namespace {

using Doubles = google::protobuf::RepeatedField<double>;

void Append(const Eigen::Vector3d& v, Doubles* column) {
  column->Add(v.data(), v.data() + 3);
}

void Append(const Eigen::Quaterniond& q, Doubles* column) {
  for (const double number : {q.w(), q.x(), q.y(), q.z()}) column->Add(number);
}

Eigen::Vector3d Vector3At(const Doubles& column, int k) {
  return Eigen::Vector3d(column.data() + 3 * k);
}

Eigen::Quaterniond QuaternionAt(const Doubles& column, int k) {
  const double* q = column.data() + 4 * k;
  return {q[0], q[1], q[2], q[3]};
}

// Compares the length of each column with that of the first.
class Columns {
 public:
  Columns(std::string prefix,
          int rows,
          const char* rows_of,
          std::vector<Violation>* violations)
      : prefix_(std::move(prefix)),
        rows_(rows),
        rows_of_(rows_of),
        violations_(violations) {}

  template <typename Column>
  void Check(const char* name, const Column& column, int width) {
    const std::int64_t expected = std::int64_t{rows_} * width;
    if (column.size() == expected) return;
    ok_ = false;
    violations_->push_back({prefix_ + name,
                            "has " + std::to_string(column.size()) +
                                " numbers; send " + std::to_string(width) +
                                " for each of the " + std::to_string(rows_) +
                                " entries of " + rows_of_});
  }

  bool ok() const { return ok_; }

 private:
  std::string prefix_;
  int rows_;
  const char* rows_of_;
  std::vector<Violation>* violations_;
  bool ok_ = true;
};

void ReadKeyframes(const v1::MotionSegment::Keyframes& message,
                   const std::string& prefix,
                   std::vector<KeyframeState>* keyframes,
                   std::vector<Violation>* violations) {
  const int n = message.t_ns_size();
  Columns columns(prefix, n, "t_ns", violations);
  columns.Check("q_gi", message.q_gi(), 4);
  columns.Check("p_gi", message.p_gi(), 3);
  columns.Check("v_gi", message.v_gi(), 3);
  columns.Check("b_a", message.b_a(), 3);
  columns.Check("b_g", message.b_g(), 3);
  if (!columns.ok()) return;
  keyframes->reserve(n);
  for (int k = 0; k < n; ++k) {
    keyframes->push_back({.t_ns = message.t_ns(k),
                          .q_GI = QuaternionAt(message.q_gi(), k),
                          .p_GI = Vector3At(message.p_gi(), k),
                          .v_GI = Vector3At(message.v_gi(), k),
                          .b_a = Vector3At(message.b_a(), k),
                          .b_g = Vector3At(message.b_g(), k)});
  }
}

void ReadImu(const v1::MotionSegment::ImuSamples& message,
             const std::string& prefix,
             std::vector<ImuSample>* imu,
             std::vector<Violation>* violations) {
  const int n = message.t_ns_size();
  Columns columns(prefix, n, "t_ns", violations);
  columns.Check("gyro", message.gyro(), 3);
  columns.Check("accel", message.accel(), 3);
  if (!columns.ok()) return;
  imu->reserve(n);
  for (int k = 0; k < n; ++k) {
    imu->push_back({message.t_ns(k),
                    Vector3At(message.gyro(), k),
                    Vector3At(message.accel(), k)});
  }
}

void ReadLandmarks(const v1::MotionSegment::Landmarks& message,
                   const std::string& prefix,
                   std::vector<Landmark>* landmarks,
                   std::vector<Violation>* violations) {
  const int n = message.id_size();
  Columns columns(prefix, n, "id", violations);
  columns.Check("p_g", message.p_g(), 3);
  if (!columns.ok()) return;
  landmarks->reserve(n);
  for (int k = 0; k < n; ++k) {
    landmarks->push_back({message.id(k), Vector3At(message.p_g(), k)});
  }
}

void ReadObservations(const v1::MotionSegment::Observations& message,
                      const std::string& prefix,
                      std::vector<Observation>* observations,
                      std::vector<Violation>* violations) {
  const int n = message.keyframe_size();
  Columns columns(prefix, n, "keyframe", violations);
  columns.Check("camera", message.camera(), 1);
  columns.Check("landmark", message.landmark(), 1);
  columns.Check("z_px", message.z_px(), 2);
  if (!columns.ok()) return;
  observations->reserve(n);
  for (int k = 0; k < n; ++k) {
    observations->push_back({message.keyframe(k),
                             message.camera(k),
                             message.landmark(k),
                             {message.z_px(2 * k), message.z_px(2 * k + 1)}});
  }
}

void FillKeyframes(const std::vector<KeyframeState>& keyframes,
                   v1::MotionSegment::Keyframes* message) {
  for (const KeyframeState& state : keyframes) {
    message->add_t_ns(state.t_ns);
    Append(state.q_GI, message->mutable_q_gi());
    Append(state.p_GI, message->mutable_p_gi());
    Append(state.v_GI, message->mutable_v_gi());
    Append(state.b_a, message->mutable_b_a());
    Append(state.b_g, message->mutable_b_g());
  }
}

void FillImu(const std::vector<ImuSample>& samples,
             v1::MotionSegment::ImuSamples* message) {
  for (const ImuSample& sample : samples) {
    message->add_t_ns(sample.t_ns);
    Append(sample.gyro, message->mutable_gyro());
    Append(sample.accel, message->mutable_accel());
  }
}

void FillObservations(const std::vector<Observation>& observations,
                      v1::MotionSegment::Observations* message) {
  for (const Observation& observation : observations) {
    message->add_keyframe(observation.keyframe);
    message->add_camera(observation.camera);
    message->add_landmark(observation.landmark);
    message->add_z_px(observation.z_px.x());
    message->add_z_px(observation.z_px.y());
  }
}

}  // namespace

v1::MotionSegment ToProto(const MotionSegment& segment) {
  v1::MotionSegment message;
  message.set_session(segment.key.session);
  message.set_index(segment.key.index);
  message.set_calibration_version(segment.calibration_version);
  FillKeyframes(segment.keyframes, message.mutable_keyframes());
  FillImu(segment.imu, message.mutable_imu());
  if (!segment.imu1.empty()) FillImu(segment.imu1, message.mutable_imu1());
  auto* landmarks = message.mutable_landmarks();
  for (const Landmark& landmark : segment.landmarks) {
    landmarks->add_id(landmark.id);
    Append(landmark.p_G, landmarks->mutable_p_g());
  }
  FillObservations(segment.observations, message.mutable_observations());
  if (segment.temperature_c) message.set_temperature_c(*segment.temperature_c);
  if (segment.session_start_ns) {
    message.set_session_start_ns(*segment.session_start_ns);
  }
  return message;
}

std::vector<Violation> FromProto(const v1::MotionSegment& message,
                                 const std::string& prefix,
                                 MotionSegment* segment) {
  std::vector<Violation> violations;
  MotionSegment read;
  read.key = {message.session(), message.index()};
  if (message.calibration_version() != 0) {
    read.calibration_version = message.calibration_version();
  }
  if (message.has_temperature_c()) {
    read.temperature_c = message.temperature_c();
  }
  if (message.has_session_start_ns()) {
    read.session_start_ns = message.session_start_ns();
  }
  // A segment may have no observations, but must have keyframes and samples.
  if (!message.has_keyframes()) {
    violations.push_back({prefix + "keyframes", "is missing"});
  }
  if (!message.has_imu()) violations.push_back({prefix + "imu", "is missing"});
  ReadKeyframes(
      message.keyframes(), prefix + "keyframes.", &read.keyframes, &violations);
  ReadImu(message.imu(), prefix + "imu.", &read.imu, &violations);
  ReadImu(message.imu1(), prefix + "imu1.", &read.imu1, &violations);
  ReadLandmarks(
      message.landmarks(), prefix + "landmarks.", &read.landmarks, &violations);
  ReadObservations(message.observations(),
                   prefix + "observations.",
                   &read.observations,
                   &violations);
  if (violations.empty()) *segment = std::move(read);
  return violations;
}

}  // namespace selfcal
