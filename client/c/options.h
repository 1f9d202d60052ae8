// Conversion of the options of the C interface into those of the C++ client.
#pragma once

#include <absl/status/statusor.h>

#include "client/c/selfcal.h"
#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"

namespace selfcal::c {

// INVALID_ARGUMENT, with the name of the member, for a wrong struct_size, a
// value out of range or a required member that is missing.
absl::StatusOr<client::ClientOptions> ToOptions(
    const selfcal_client_options* given);
absl::StatusOr<client::SegmentBuilderOptions> ToOptions(
    const selfcal_builder_options* given);

}  // namespace selfcal::c
