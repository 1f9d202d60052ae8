// Messages of the validation and the verdict of a candidate, as they are stored
// and served.
#pragma once

#include "selfcal/v1/calibration_service.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

v1::Validation ValidationMessage(const StoredValidation& validation,
                                 bool accepted);
v1::Verdict VerdictMessage(const Verdict& verdict);  // without its text

}  // namespace selfcal::server
