// Mistakes about the IMU and the frame of gravity.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "test/core/preflight/mistakes.h"

namespace selfcal {
namespace {

using Kind = FindingKind;

constexpr double kDegrees = 180 / std::numbers::pi;

void ForSamples(FedData* data, const std::function<void(ImuSample*)>& change) {
  for (MotionSegment& segment : data->segments) {
    for (ImuSample& sample : segment.imu) change(&sample);
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

// The clock of the images has an offset from that of the IMU.
void ShiftKeyframes(FedData* data, std::int64_t by_ns) {
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) state.t_ns += by_ns;
  }
}

// A frame whose axes are m times those of G, for everything that the SLAM
// system exports.
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

// Limits the range of the sensor to `part` of its largest reading about x.
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

// A driver that removes gravity, with the attitude of the SLAM system.
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

}  // namespace

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

}  // namespace selfcal
