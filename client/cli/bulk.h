// Commands that change every rig of a filter. They show what they would do,
// ask, and go on after a rig that fails.
#pragma once

#include <grpcpp/support/status.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "client/cli/context.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/uplink.pb.h"

namespace selfcal::client {

struct BulkOptions {
  std::string filter;
  bool dry_run = false;
  bool yes = false;
};

// --filter, and --dry-run and --yes, which need it. Returns the former.
CLI::Option* AddBulkOptions(CLI::App* command, BulkOptions* options);

// Reads the rigs of the filter.
grpc::Status ReadRigs(const Context& context,
                      const std::string& filter,
                      std::vector<v1::Rig>* rigs);

struct BulkChange {
  std::string rig;
  std::function<grpc::Status()> call;
  // The same call, for the device if it reports the rig.
  v1::Instruction instruction = {};
};

// UpdateRig, of the rig that the request names; `stub` must outlive the change.
BulkChange UpdateOf(v1::RigService::StubInterface* stub,
                    const v1::UpdateRigRequest& request);

// The words of messages about a change: "Roll back 3 rigs at ...?", "tablet is
// not rolled back: ...".
struct BulkWords {
  std::string imperative;  // "Roll back"
  std::string participle;  // "rolled back"
};

// Makes the changes, which have been shown, unless this is a dry run or the
// answer to the question is no. Returns the exit code.
int CarryOut(const Context& context,
             const BulkOptions& options,
             const BulkWords& words,
             const std::vector<BulkChange>& changes);

}  // namespace selfcal::client
