#include "server/encode/encode_estimate.h"

#include "proto/resource_names.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"

namespace selfcal::server {

v1::Estimate Encode(const StoredEstimate& estimate) {
  v1::Estimate message;
  message.set_rig(RigName(estimate.rig));
  message.set_version(estimate.version);
  message.set_state(EncodeCalibrationState(estimate.state));
  SetTime(estimate.create_time_ns, message.mutable_create_time());
  message.set_component(estimate.component);
  message.set_unit(estimate.unit);
  message.set_value(estimate.value);
  if (estimate.sigma) message.set_sigma(*estimate.sigma);
  if (estimate.from_factory) message.set_from_factory(*estimate.from_factory);
  return message;
}

}  // namespace selfcal::server
