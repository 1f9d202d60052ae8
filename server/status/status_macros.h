// Macros that propagate errors; Abseil has none of its own.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <utility>

// Returns the status of `expression` from the function unless it is OK.
#define SELFCAL_RETURN_IF_ERROR(expression)          \
  do {                                               \
    absl::Status selfcal_status = (expression);      \
    if (!selfcal_status.ok()) return selfcal_status; \
  } while (false)

#define SELFCAL_CONCAT_INNER(a, b) a##b
#define SELFCAL_CONCAT(a, b) SELFCAL_CONCAT_INNER(a, b)

// Returns the status of `expression`, a StatusOr, unless it is OK; otherwise
// moves its value into `target`, which may be a declaration.
#define SELFCAL_ASSIGN_OR_RETURN(target, expression)                  \
  auto SELFCAL_CONCAT(selfcal_or_, __LINE__) = (expression);          \
  if (!SELFCAL_CONCAT(selfcal_or_, __LINE__).ok()) {                  \
    return std::move(SELFCAL_CONCAT(selfcal_or_, __LINE__)).status(); \
  }                                                                   \
  target = std::move(SELFCAL_CONCAT(selfcal_or_, __LINE__)).value()
