#include "test/core/preflight/mistakes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "core/model/so3.h"

namespace selfcal {
namespace {

using Kind = FindingKind;

constexpr double kDegrees = 180 / std::numbers::pi;

void ForSamples(FedData* data, const std::function<void(ImuSample*)>& change) {
  for (MotionSegment& segment : data->segments) {
    for (ImuSample& sample : segment.imu) change(&sample);
  }
}

void ForLandmarks(FedData* data,
                  const std::function<void(Eigen::Vector3d*)>& change) {
  for (MotionSegment& segment : data->segments) {
    for (Landmark& landmark : segment.landmarks) change(&landmark.p_G);
  }
}

Eigen::Matrix3d Rows(const Eigen::Vector3d& x,
                     const Eigen::Vector3d& y,
                     const Eigen::Vector3d& z) {
  Eigen::Matrix3d m;
  m << x.transpose(), y.transpose(), z.transpose();
  return m;
}

// The driver's frame is not the body frame: all six readings in other axes.
void TurnImu(FedData* data, const Eigen::Matrix3d& m) {
  ForSamples(data, [&](ImuSample* s) {
    s->gyro = m * s->gyro;
    s->accel = m * s->accel;
  });
}

// The clock of the images runs apart from that of the IMU.
void ShiftKeyframes(FedData* data, std::int64_t by_ns) {
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) state.t_ns += by_ns;
  }
}

// A frame whose axes are m times those of G, for all that the SLAM system says.
void TurnWorld(FedData* data, const Eigen::Matrix3d& m) {
  const Eigen::Quaterniond q(m);
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.q_GI = q * state.q_GI;
      state.p_GI = m * state.p_GI;
      state.v_GI = m * state.v_GI;
    }
  }
  ForLandmarks(data, [&](Eigen::Vector3d* p) { *p = m * *p; });
}

// Samples lost one by one.
void DropSamples(FedData* data, double share) {
  std::mt19937 random(1);
  for (MotionSegment& segment : data->segments) {
    std::vector<ImuSample> kept;
    for (const ImuSample& sample : segment.imu) {
      const bool end =
          &sample == &segment.imu.front() || &sample == &segment.imu.back();
      if (end || static_cast<double>(random()) >= share * 4294967296.0) {
        kept.push_back(sample);
      }
    }
    segment.imu = kept;
  }
}

// A driver that sends the last reading again where one was lost.
void RepeatReadings(FedData* data, double share) {
  std::mt19937 random(1);
  for (MotionSegment& segment : data->segments) {
    for (std::size_t i = 1; i < segment.imu.size(); ++i) {
      if (static_cast<double>(random()) >= share * 4294967296.0) continue;
      segment.imu[i].gyro = segment.imu[i - 1].gyro;
      segment.imu[i].accel = segment.imu[i - 1].accel;
    }
  }
}

// A range of the sensor at `part` of what it reads at most about x.
void Saturate(FedData* data, bool gyro, double part) {
  const auto axis = [&](ImuSample* s) -> double& {
    return gyro ? s->gyro.x() : s->accel.x();
  };
  double most = 0;
  ForSamples(data,
             [&](ImuSample* s) { most = std::max(most, std::abs(axis(s))); });
  ForSamples(data, [&](ImuSample* s) {
    axis(s) = std::clamp(axis(s), -part * most, part * most);
  });
}

// A driver that takes gravity away, by the attitude of the SLAM system.
void RemoveGravity(FedData* data) {
  for (MotionSegment& segment : data->segments) {
    std::size_t k = 0;
    for (ImuSample& sample : segment.imu) {
      const auto& keyframes = segment.keyframes;
      while (k + 2 < keyframes.size() && keyframes[k + 1].t_ns <= sample.t_ns) {
        ++k;
      }
      const double part =
          static_cast<double>(sample.t_ns - keyframes[k].t_ns) /
          static_cast<double>(keyframes[k + 1].t_ns - keyframes[k].t_ns);
      const Eigen::Quaterniond q = keyframes[k].q_GI.slerp(
          std::clamp(part, 0., 1.), keyframes[k + 1].q_GI);
      sample.accel -=
          q.conjugate() * Eigen::Vector3d(0, 0, data->rig.gravity_mps2);
    }
  }
}

void InvertExtrinsics(FedData* data) {
  for (CameraCalibration& camera : data->rig.factory.cameras) {
    camera.q_CI = camera.q_CI.conjugate();
    camera.p_CI = -(camera.q_CI * camera.p_CI);
  }
}

// States of the camera handed on as those of the body.
void SendCameraPoses(FedData* data) {
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  const Eigen::Quaterniond q_IC = camera.q_CI.conjugate();
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.p_GI -= state.q_GI * (q_IC * camera.p_CI);
      state.q_GI = state.q_GI * q_IC;
    }
  }
}

// The bridge has the extrinsics inverted and makes the poses of the body from
// those of the camera with them: landmarks project as they should.
void MakePosesByInverse(FedData* data) {
  SendCameraPoses(data);
  InvertExtrinsics(data);
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.p_GI += state.q_GI * camera.p_CI;
      state.q_GI = state.q_GI * camera.q_CI;
    }
  }
}

// A calibration made at another resolution of the images.
void ScaleCamera(FedData* data, double by) {
  for (CameraCalibration& camera : data->rig.factory.cameras) {
    camera.f *= by;
    camera.c *= by;
    camera.width_px = static_cast<int>(std::lround(by * camera.width_px));
    camera.height_px = static_cast<int>(std::lround(by * camera.height_px));
  }
}

// Landmarks as the front end has them: in the camera that saw them first.
void AnchorLandmarks(FedData* data) {
  for (MotionSegment& segment : data->segments) {
    std::map<int, std::pair<int, int>> first;  // keyframe and camera
    for (const Observation& o : segment.observations) {
      const std::pair seen(o.keyframe, o.camera);
      const auto [at, added] = first.emplace(o.landmark, seen);
      if (!added) at->second = std::min<std::pair<int, int>>(at->second, seen);
    }
    for (const auto& [landmark, seen] : first) {
      const CameraCalibration& camera = data->rig.factory.cameras[seen.second];
      Eigen::Vector3d& p = segment.landmarks[landmark].p_G;
      const KeyframeState& state = segment.keyframes[seen.first];
      p = camera.q_CI * (state.q_GI.conjugate() * (p - state.p_GI)) +
          camera.p_CI;
    }
  }
}

// Landmarks in the frame of the session's first camera, as ORB-SLAM's map has
// them, beside poses in G.
void LandmarksOfFirstCamera(FedData* data) {
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  const KeyframeState state = data->segments.front().keyframes.front();
  ForLandmarks(data, [&](Eigen::Vector3d* p) {
    *p = camera.q_CI * (state.q_GI.conjugate() * (*p - state.p_GI)) +
         camera.p_CI;
  });
}

std::vector<Mistake> ImuMistakes() {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  return {
      {"axes_swapped",
       {Kind::kImuAxes},
       "(y, x, -z)",
       "as (y, x, -z)",
       [=](FedData* d) { TurnImu(d, Rows(y, x, -z)); }},
      {"axes_cycled",
       {Kind::kImuAxes},
       "(y, z, x)",
       "as (y, z, x)",
       [=](FedData* d) { TurnImu(d, Rows(z, x, y)); }},
      {"axes_flipped",
       {Kind::kImuAxes},
       "(x, -y, -z)",
       "as (x, -y, -z)",
       [=](FedData* d) { TurnImu(d, Rows(x, -y, -z)); }},
      {"gyro_z_flipped",
       {Kind::kImuAxes},
       "(x, y, -z)",
       "the rates as",
       [=](FedData* d) {
         ForSamples(d, [](ImuSample* s) { s->gyro.z() *= -1; });
       }},
      {"gyro_deg_per_s",
       {Kind::kGyroUnits},
       "in deg/s",
       "by 0.0175",
       [=](FedData* d) {
         ForSamples(d, [](ImuSample* s) { s->gyro *= kDegrees; });
       }},
      {"gyro_converted_twice",
       {Kind::kGyroUnits},
       "times pi/180",
       "by 57.3",
       [=](FedData* d) {
         ForSamples(d, [](ImuSample* s) { s->gyro /= kDegrees; });
       }},
      {"accel_in_g",
       {Kind::kAccelUnits},
       "in g",
       "by 9.81",
       [](FedData* d) {
         ForSamples(d, [](ImuSample* s) { s->accel /= 9.80665; });
       }},
      {"gravity_sign",
       {Kind::kGravity},
       "wrong sign",
       "at rest points up",
       [](FedData* d) { ForSamples(d, [](ImuSample* s) { s->accel *= -1; }); }},
      {"gravity_removed",
       {Kind::kGravity},
       "missing",
       "specific force",
       RemoveGravity},
      {"world_z_down",
       {Kind::kGravity},
       "wrong sign",
       "z axis points up",
       [=](FedData* d) { TurnWorld(d, Rows(x, -y, -z)); }},
      {"world_of_first_camera",
       {Kind::kGravity},
       "G is not level",
       "z axis points up",
       [=](FedData* d) { TurnWorld(d, Rows(-y, -z, x)); }},
      {"images_30ms_late",
       {Kind::kTimeOffset},
       "earlier",
       "time_offset_s",
       [](FedData* d) { ShiftKeyframes(d, -30'000'000); },
       0.03},
      {"images_150ms_early",
       {Kind::kTimeOffset},
       "later",
       "time_offset_s",
       [](FedData* d) { ShiftKeyframes(d, 150'000'000); },
       -0.15},
      {"samples_dropped",
       {Kind::kDroppedSamples},
       "missing",
       "queue",
       [](FedData* d) { DropSamples(d, 0.03); }},
      {"samples_repeated",
       {Kind::kRepeatedSamples},
       "repeated",
       "once",
       [](FedData* d) { RepeatReadings(d, 0.03); }},
      {"gyro_saturated",
       {Kind::kSaturation},
       "gyroscope saturates",
       "range",
       [](FedData* d) { Saturate(d, true, 0.6); }},
      {"accel_saturated",
       {Kind::kSaturation},
       "accelerometer saturates",
       "range",
       [](FedData* d) { Saturate(d, false, 0.8); }},
      {"axes_and_units",
       {Kind::kImuAxes, Kind::kGyroUnits, Kind::kAccelUnits},
       "",
       "",
       [=](FedData* d) {
         TurnImu(d, Rows(y, -x, z));
         ForSamples(d, [](ImuSample* s) {
           s->gyro *= kDegrees;
           s->accel /= 9.80665;
         });
       }},
  };
}

std::vector<Mistake> CameraMistakes() {
  return {
      {"extrinsics_inverted",
       {Kind::kExtrinsics},
       "are inverted",
       "invert",
       InvertExtrinsics},
      {"rotation_inverted",
       {Kind::kExtrinsics},
       "rotation",
       "conjugate",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) {
           camera.q_CI = camera.q_CI.conjugate();
         }
       }},
      {"camera_poses",
       {Kind::kExtrinsics},
       "poses of the camera",
       "poses of the body",
       SendCameraPoses},
      {"poses_by_inverted_extrinsics",
       {Kind::kExtrinsics},
       "made with inverted",
       "invert",
       MakePosesByInverse},
      {"calibrated_at_double_size",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 2); },
       0.5},
      {"calibrated_at_half_size",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 0.5); },
       2},
      {"calibrated_at_two_thirds",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 2. / 3); },
       1.5},
      {"focal_length_alone",
       {Kind::kFocalLength},
       "focal length is wrong",
       "multiply",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) camera.f *= 1.25;
       },
       0.8},
      {"image_cropped",
       {Kind::kFocalLength},
       "principal point",
       "principal",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) camera.c.x() += 80;
       },
       80},
      {"landmarks_in_camera",
       {Kind::kLandmarkFrame},
       "camera frame",
       "landmarks in G",
       AnchorLandmarks},
      {"landmarks_of_first_camera",
       {Kind::kLandmarkFrame},
       "another frame",
       "same frame G",
       LandmarksOfFirstCamera},
      {"landmarks_in_mm",
       {Kind::kLandmarkFrame},
       "when scaled by",
       "metres",
       [](FedData* d) {
         ForLandmarks(d, [](Eigen::Vector3d* p) { *p *= 1000; });
       },
       0.001},
  };
}

}  // namespace

std::vector<Mistake> Mistakes() {
  std::vector<Mistake> all = ImuMistakes();
  for (Mistake& mistake : CameraMistakes()) all.push_back(std::move(mistake));
  return all;
}

std::vector<FindingKind> Kinds(const Diagnosis& diagnosis) {
  std::vector<FindingKind> kinds;
  for (const Finding& f : diagnosis.findings) kinds.push_back(f.kind);
  std::sort(kinds.begin(), kinds.end());
  kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
  return kinds;
}

std::string Text(const Diagnosis& diagnosis) {
  std::string text;
  for (const Finding& f : diagnosis.findings) {
    text += "  " + std::string(FindingName(f.kind)) + ": " + f.cause +
            "\n    " + f.remedy + "\n";
  }
  for (const std::string& line : diagnosis.checked)
    text += "  + " + line + "\n";
  for (const std::string& line : diagnosis.not_checked) {
    text += "  - " + line + "\n";
  }
  return text;
}

}  // namespace selfcal
