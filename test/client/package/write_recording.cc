// Writes a simulated session as the example of the installed package reads it,
// and its rig as `selfcal rig create` does: rig.json, imu.csv, keyframes.csv,
// observations.csv in the folder that is named.
#include <fmt/os.h>
#include <google/protobuf/util/json_util.h>

#include <iostream>
#include <string>

#include "core/simulation/simulate.h"
#include "proto/convert.h"
#include "test/system/looped_session.h"

namespace selfcal::client {
namespace {

constexpr int kKeyframes = 161;  // four segments, and what closes the last

template <typename Vector>
std::string Join(const Vector& v) {
  std::string text;
  for (int i = 0; i < v.size(); ++i) text += fmt::format(",{}", v[i]);
  return text;
}

bool Write(const std::string& dir) {
  const Rig rig = HandheldRig("packaged");
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(ToProto(rig), &json).ok()) {
    return false;
  }
  fmt::output_file(dir + "/rig.json").print("{}", json);
  auto imu = fmt::output_file(dir + "/imu.csv");
  auto keyframes = fmt::output_file(dir + "/keyframes.csv");
  auto observations = fmt::output_file(dir + "/observations.csv");
  LoopedSession session(rig, rig.factory);
  for (int k = 0; k < kKeyframes; ++k) {
    const LoopedSession::Step step = session.Next(k);
    for (const ImuSample& sample : step.before) {
      imu.print("{}{}{}\n", sample.t_ns, Join(sample.gyro), Join(sample.accel));
    }
    const KeyframeState& x = step.state;
    const Eigen::Vector4d q(x.q_GI.w(), x.q_GI.x(), x.q_GI.y(), x.q_GI.z());
    keyframes.print("{}{}{}{}{}{}\n",
                    x.t_ns,
                    Join(q),
                    Join(x.p_GI),
                    Join(x.v_GI),
                    Join(x.b_a),
                    Join(x.b_g));
    for (const KeyframeObservation& seen : step.observations) {
      observations.print("{},{},{}{}{}\n",
                         x.t_ns,
                         seen.camera,
                         seen.landmark_id,
                         Join(seen.z_px),
                         Join(seen.p_G));
    }
  }
  return true;
}

}  // namespace
}  // namespace selfcal::client

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " DIR\n";
    return 2;
  }
  return selfcal::client::Write(argv[1]) ? 0 : 1;
}
