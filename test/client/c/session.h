// A session as a SLAM system gives it, in the structs of the C interface. Plain
// C++11.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "client/c/selfcal.h"

namespace selfcal {
namespace testing_c {

struct Keyframe {
  selfcal_keyframe_state state;
  std::vector<selfcal_observation> observations;
};

struct Session {
  std::vector<selfcal_imu_sample> imu;
  std::vector<Keyframe> keyframes;
};

// Numbers that differ everywhere, so that two that are exchanged are noticed.
class Numbers {
 public:
  double Next() { return std::sin(static_cast<double>(++count_)); }
  template <std::size_t N>
  void Fill(double (&values)[N]) {
    for (double& value : values) value = Next();
  }

 private:
  int count_ = 0;
};

// Keyframes each 0.1 s, samples each 5 ms. A landmark is seen from up to eight
// keyframes, by two cameras.
inline Session MakeSession(int keyframes) {
  Session session;
  Numbers numbers;
  for (std::int64_t k = 0; k < keyframes; ++k) {
    for (std::int64_t i = 0; i < 20; ++i) {
      selfcal_imu_sample sample;
      sample.t_ns = 100000000 * k + 5000000 * i;
      numbers.Fill(sample.gyro);
      numbers.Fill(sample.accel);
      session.imu.push_back(sample);
    }
    Keyframe keyframe;
    keyframe.state.t_ns = 100000000 * k + 2000000;
    keyframe.state.q_GI.w = 0.46;
    keyframe.state.q_GI.x = 0.16;
    keyframe.state.q_GI.y = -0.72;
    keyframe.state.q_GI.z = 0.49;
    numbers.Fill(keyframe.state.p_GI);
    numbers.Fill(keyframe.state.v_GI);
    numbers.Fill(keyframe.state.b_a);
    numbers.Fill(keyframe.state.b_g);
    for (std::int64_t i = 0; i < 40; ++i) {
      selfcal_observation seen;
      std::memset(&seen, 0, sizeof(seen));
      seen.landmark_id = static_cast<std::uint64_t>(5 * k + i);
      seen.camera = static_cast<std::int32_t>(i % 2);
      numbers.Fill(seen.z_px);
      numbers.Fill(seen.p_G);
      keyframe.observations.push_back(seen);
    }
    session.keyframes.push_back(keyframe);
  }
  return session;
}

}  // namespace testing_c
}  // namespace selfcal
