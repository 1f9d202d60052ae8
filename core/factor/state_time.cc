#include "core/factor/state_time.h"

#include "core/factor/keyframe_motion.h"
#include "core/model/rig.h"

namespace selfcal {

KeyframeState MoveState(const KeyframeState& state,
                        std::int64_t t_ns,
                        std::span<const ImuSample> samples,
                        const ImuCalibration& imu,
                        double gravity_mps2) {
  KeyframeState moved = state;
  moved.t_ns = t_ns;
  if (samples.empty() || t_ns == state.t_ns) return moved;
  // The noise matters only to the derivatives of the motion.
  const KeyframeMotion motion =
      MeasureMotion(samples,
                    state,
                    imu,
                    ImuNoise{},
                    gravity_mps2,
                    static_cast<double>(t_ns - state.t_ns) * 1e-9);
  moved.q_GI = (state.q_GI * motion.turn).normalized();
  moved.p_GI = state.p_GI + state.q_GI * motion.shift_I;
  moved.v_GI = state.q_GI * motion.v_I;
  return moved;
}

}  // namespace selfcal
