// A parameter of a version as the message of the contract.
#pragma once

#include "selfcal/v1/fleet.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

v1::Estimate Encode(const StoredEstimate& estimate);

}  // namespace selfcal::server
