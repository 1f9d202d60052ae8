#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cctype>
#include <optional>
#include <string>
#include <utility>

#include "core/model/camera_model.h"
#include "core/model/parameter_blocks.h"
#include "core/model/temperature.h"
#include "core/model/too_many.h"
#include "proto/convert.h"

namespace selfcal {
namespace {

using Violations = std::vector<Violation>;

void Fill(const Eigen::Vector2d& v, v1::Vector2* message) {
  message->set_x(v.x());
  message->set_y(v.y());
}

void Fill(const Eigen::Vector3d& v, v1::Vector3* message) {
  message->set_x(v.x());
  message->set_y(v.y());
  message->set_z(v.z());
}

void Fill(const Eigen::Quaterniond& q, v1::Quaternion* message) {
  message->set_w(q.w());
  message->set_x(q.x());
  message->set_y(q.y());
  message->set_z(q.z());
}

Eigen::Vector2d Value(const v1::Vector2& message) {
  return {message.x(), message.y()};
}

Eigen::Vector3d Value(const v1::Vector3& message) {
  return {message.x(), message.y(), message.z()};
}

Eigen::Quaterniond Value(const v1::Quaternion& message) {
  return {message.w(), message.x(), message.y(), message.z()};
}

void Require(bool present, std::string field, Violations* violations) {
  if (!present) violations->push_back({std::move(field), "is missing"});
}

// The name of a model in the contract: DISTORTION_MODEL_RADIAL_TANGENTIAL for
// "radial-tangential".
std::string ProtoName(DistortionModel model) {
  std::string name = "DISTORTION_MODEL_";
  for (const char letter : DistortionName(model)) {
    name += letter == '-' ? '_'
                          : static_cast<char>(std::toupper(
                                static_cast<unsigned char>(letter)));
  }
  return name;
}

v1::DistortionModel ToProto(DistortionModel model) {
  v1::DistortionModel message = v1::DISTORTION_MODEL_UNSPECIFIED;
  v1::DistortionModel_Parse(ProtoName(model), &message);
  return message;
}

bool FromProto(v1::DistortionModel message, DistortionModel* model) {
  for (const DistortionModel candidate : DistortionModels()) {
    if (ToProto(candidate) != message) continue;
    *model = candidate;
    return true;
  }
  return false;
}

const google::protobuf::FieldDescriptor* FieldOf(
    const BlockInfo& info, const google::protobuf::Message& message) {
  std::string name;
  for (const char letter : info.field) {
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  }
  return message.GetDescriptor()->FindFieldByName(name);
}

// The message of a block in that of its sensor.
template <class Part>
Part* MutablePart(const BlockInfo& info, google::protobuf::Message* message) {
  return google::protobuf::DynamicCastToGenerated<Part>(
      message->GetReflection()->MutableMessage(message,
                                               FieldOf(info, *message)));
}

void FillBlock(const BlockInfo& info,
               const Eigen::Vector2d& value,
               google::protobuf::Message* message) {
  Fill(value, MutablePart<v1::Vector2>(info, message));
}
void FillBlock(const BlockInfo& info,
               const Eigen::Vector3d& value,
               google::protobuf::Message* message) {
  Fill(value, MutablePart<v1::Vector3>(info, message));
}
void FillBlock(const BlockInfo& info,
               const Eigen::Quaterniond& value,
               google::protobuf::Message* message) {
  Fill(value, MutablePart<v1::Quaternion>(info, message));
}
void FillBlock(const BlockInfo& info,
               double value,
               google::protobuf::Message* message) {
  message->GetReflection()->SetDouble(message, FieldOf(info, *message), value);
}
void FillBlock(const BlockInfo& info,
               const std::optional<double>& value,
               google::protobuf::Message* message) {
  if (value) FillBlock(info, *value, message);
}
void FillBlock(const BlockInfo& info,
               const DistortionVector& value,
               google::protobuf::Message* message) {
  for (const double coefficient : value) {
    message->GetReflection()->AddDouble(
        message, FieldOf(info, *message), coefficient);
  }
}

void FillBlock(const BlockInfo& info,
               const OptionalVector& value,
               google::protobuf::Message* message) {
  for (const double number : value) {
    message->GetReflection()->AddDouble(
        message, FieldOf(info, *message), number);
  }
}

// Reads the message of a block; one that stored data has had from the beginning
// must be present.
template <class Part, class Read>
void ReadPart(const BlockInfo& info,
              const google::protobuf::Message& message,
              const std::string& prefix,
              Read* value,
              Violations* violations) {
  const auto* field = FieldOf(info, message);
  const auto* reflection = message.GetReflection();
  if (!reflection->HasField(message, field)) {
    Require(
        info.since != StoredSince::kBegin, prefix + field->name(), violations);
    return;
  }
  *value = Value(*google::protobuf::DynamicCastToGenerated<Part>(
      &reflection->GetMessage(message, field)));
}

void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string& prefix,
               Eigen::Vector2d* value,
               Violations* violations) {
  ReadPart<v1::Vector2>(info, message, prefix, value, violations);
}
void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string& prefix,
               Eigen::Vector3d* value,
               Violations* violations) {
  ReadPart<v1::Vector3>(info, message, prefix, value, violations);
}
void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string& prefix,
               Eigen::Quaterniond* value,
               Violations* violations) {
  ReadPart<v1::Quaternion>(info, message, prefix, value, violations);
}
void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string&,
               double* value,
               Violations*) {
  *value = message.GetReflection()->GetDouble(message, FieldOf(info, message));
}
void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string& prefix,
               std::optional<double>* value,
               Violations* violations) {
  const auto* field = FieldOf(info, message);
  if (!message.GetReflection()->HasField(message, field)) return;
  ReadBlock(info, message, prefix, &value->emplace(), violations);
}
void ReadBlock(const BlockInfo& info,
               const google::protobuf::Message& message,
               const std::string& prefix,
               OptionalVector* value,
               Violations* violations) {
  const auto* field = FieldOf(info, message);
  const auto* reflection = message.GetReflection();
  const int size = reflection->FieldSize(message, field);
  if (size > kMaxOptionalSize) {
    violations->push_back(
        {prefix + field->name(), "has " + std::to_string(size) + " values"});
    return;
  }
  value->resize(size);
  for (int i = 0; i < size; ++i) {
    (*value)[i] = reflection->GetRepeatedDouble(message, field, i);
  }
}
// ReadDistortion reads the coefficients with their model.
void ReadBlock(const BlockInfo&,
               const google::protobuf::Message&,
               const std::string&,
               DistortionVector*,
               Violations*) {}

void ReadDistortion(const v1::CameraCalibration& message,
                    const std::string& prefix,
                    CameraCalibration* camera,
                    Violations* violations) {
  if (!FromProto(message.distortion_model(), &camera->model)) {
    violations->push_back(
        {prefix + "distortion_model",
         "is " + std::to_string(static_cast<int>(message.distortion_model())) +
             "; send one of the models of DistortionModel"});
    return;
  }
  const int size = DistortionSize(camera->model);
  if (message.distortion_size() != size) {
    violations->push_back({prefix + "distortion",
                           "has " + std::to_string(message.distortion_size()) +
                               " coefficients; the model takes " +
                               std::to_string(size)});
    return;
  }
  camera->distortion =
      Eigen::Map<const Eigen::VectorXd>(message.distortion().data(), size);
}

template <class Sensor>
void FillSensor(const Sensor& sensor, google::protobuf::Message* message) {
  VisitWithSlopes([&](const BlockInfo& info,
                      const auto& value) { FillBlock(info, value, message); },
                  sensor);
}

template <class Sensor>
void ReadSensor(const google::protobuf::Message& message,
                const std::string& prefix,
                Sensor* sensor,
                Violations* violations) {
  VisitWithSlopes(
      [&](const BlockInfo& info, auto& value) {
        ReadBlock(info, message, prefix, &value, violations);
      },
      *sensor);
}

void ReadCamera(const v1::CameraCalibration& message,
                const std::string& prefix,
                CameraCalibration* camera,
                Violations* violations) {
  ReadSensor(message, prefix, camera, violations);
  camera->width_px = message.width_px();
  camera->height_px = message.height_px();
  ReadDistortion(message, prefix, camera, violations);
}

}  // namespace

v1::CalibrationParameters ToProto(const Calibration& theta) {
  v1::CalibrationParameters message;
  FillSensor(theta.imu, message.mutable_imu());
  if (theta.imu1) FillSensor(*theta.imu1, message.mutable_imu1());
  for (const CameraCalibration& camera : theta.cameras) {
    v1::CameraCalibration* added = message.add_cameras();
    FillSensor(camera, added);
    added->set_distortion_model(ToProto(camera.model));
    added->set_width_px(camera.width_px);
    added->set_height_px(camera.height_px);
  }
  if (HasSlopes(theta)) {
    message.set_reference_temperature_c(theta.reference_temperature_c);
  }
  return message;
}

Violations FromProto(const v1::CalibrationParameters& message,
                     const std::string& prefix,
                     Calibration* theta) {
  Violations violations;
  Calibration read;
  if (message.has_imu()) {
    ReadSensor(message.imu(), prefix + "imu.", &read.imu, &violations);
    for (const auto& [present, field] :
         {std::pair(message.imu().has_q_ji(), "imu.q_ji"),
          std::pair(message.imu().has_p_ji(), "imu.p_ji")}) {
      if (!present) continue;
      violations.push_back(
          {prefix + field,
           "is the pose of a second IMU; the first one defines the frame I and "
           "has none"});
    }
    if (message.imu().time_offset_s() != 0) {
      violations.push_back(
          {prefix + "imu.time_offset_s",
           "is that of a second IMU; the first one defines the clock and has "
           "none"});
    }
  } else {
    Require(false, prefix + "imu", &violations);
  }
  if (message.has_imu1()) {
    ReadSensor(
        message.imu1(), prefix + "imu1.", &read.imu1.emplace(), &violations);
    Require(message.imu1().has_q_ji(), prefix + "imu1.q_ji", &violations);
    Require(message.imu1().has_p_ji(), prefix + "imu1.p_ji", &violations);
  }
  if (message.cameras_size() > kMaxCameras) {
    violations.push_back(
        {prefix + "cameras", TooMany(message.cameras().size(), kMaxCameras)});
    return violations;
  }
  read.cameras.resize(message.cameras_size());
  for (int i = 0; i < message.cameras_size(); ++i) {
    ReadCamera(message.cameras(i),
               prefix + "cameras[" + std::to_string(i) + "].",
               &read.cameras[i],
               &violations);
  }
  if (message.has_reference_temperature_c()) {
    read.reference_temperature_c = message.reference_temperature_c();
  }
  if (violations.empty()) *theta = std::move(read);
  return violations;
}

}  // namespace selfcal
