#include "proto/resource_names.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"

namespace selfcal::server {

v1::Event Encode(const StoredEvent& event) {
  v1::Event message;
  message.set_number(event.event);
  SetTime(event.time_ns, message.mutable_time());
  if (!event.rig.empty()) message.set_rig(RigName(event.rig));
  message.set_kind(static_cast<v1::Event::Kind>(static_cast<int>(event.kind)));
  message.set_detail(event.detail);
  return message;
}

}  // namespace selfcal::server
