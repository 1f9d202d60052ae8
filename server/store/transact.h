// Store::Transact and Store::Inspect for work that returns a value.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <type_traits>

#include "server/store/moment.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// `work` takes a UnitOfWork* and returns an absl::StatusOr, which is returned
// here once it is committed. It may be called again (Store::Work).
template <typename Work>
auto TransactFor(Store* store,
                 const RigClaim& claim,
                 const Moment& now,
                 const Work& work) -> std::invoke_result_t<Work, UnitOfWork*> {
  std::invoke_result_t<Work, UnitOfWork*> result = absl::UnknownError("");
  const absl::Status status = store->Transact(claim, now, [&](auto* tx) {
    result = work(tx);
    return result.status();
  });
  if (!status.ok()) return status;
  return result;
}

template <typename Work>
auto InspectFor(Store* store, const std::string& rig, const Work& work)
    -> std::invoke_result_t<Work, UnitOfWork*> {
  std::invoke_result_t<Work, UnitOfWork*> result = absl::UnknownError("");
  const absl::Status status = store->Inspect(rig, [&](auto* tx) {
    result = work(tx);
    return result.status();
  });
  if (!status.ok()) return status;
  return result;
}

}  // namespace selfcal::server
