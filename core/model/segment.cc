#include "core/model/segment.h"

#include "core/model/so3.h"

namespace selfcal {

KeyframeState BoxPlus(const KeyframeState& state,
                      const Eigen::Matrix<double, 15, 1>& delta) {
  KeyframeState moved = state;
  moved.q_GI =
      (state.q_GI * Exp(delta.segment<3>(kStateRotation))).normalized();
  moved.p_GI += delta.segment<3>(kStatePosition);
  moved.v_GI += delta.segment<3>(kStateVelocity);
  moved.b_a += delta.segment<3>(kStateAccelBias);
  moved.b_g += delta.segment<3>(kStateGyroBias);
  return moved;
}

}  // namespace selfcal
