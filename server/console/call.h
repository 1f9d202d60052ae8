// The handlers under /api/v1, and their helpers; internal to server/console.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <string_view>
#include <vector>

#include "server/access/rules.h"
#include "server/console/api.h"

namespace selfcal::server {

// One request; `parts` are the parts of the path at each '*' of its pattern.
struct Call {
  const ApiContext& context;
  const HttpRequest& request;
  std::vector<std::string> parts;

  // Returns a query parameter; empty if it is missing.
  std::string Query(const std::string& name) const {
    const auto found = request.query.find(name);
    return found == request.query.end() ? "" : found->second;
  }
};

using Answer = absl::StatusOr<HttpResponse>;

// Returns a query parameter that is a number >= 1; `without` if it is missing.
// INVALID_ARGUMENT, with the rule, for anything else.
absl::StatusOr<int> CountOf(const Call& call,
                            const std::string& name,
                            int without,
                            std::string_view rule);

// Returns size and token of a page; INVALID_ARGUMENT if the size is not a
// number.
absl::StatusOr<Page> PageOf(const Call& call);

// Returns the rig of the address. INVALID_ARGUMENT if it is not a valid id.
absl::StatusOr<std::string> RigOf(const Call& call);

// Returns a version of the rig, by its number or "active"; INVALID_ARGUMENT for
// anything else.
absl::StatusOr<StoredCalibration> ReadVersion(const Call& call,
                                              const std::string& id);

Answer GetSession(const Call& call);
Answer ListRigs(const Call& call);
Answer GetRig(const Call& call);
Answer ListTables(const Call& call);
Answer ListSegments(const Call& call);
Answer GetSegment(const Call& call);
Answer GetSegmentData(const Call& call);
Answer ListAbsences(const Call& call);
Answer GetInformation(const Call& call);
Answer GetResiduals(const Call& call);
Answer ListSessions(const Call& call);
Answer GetTrajectory(const Call& call);
Answer ListCalibrations(const Call& call);
Answer GetCalibration(const Call& call);
Answer ActivateCalibration(const Call& call);
Answer CompareCalibrations(const Call& call);
Answer AdviseMotion(const Call& call);
Answer ListRuns(const Call& call);
Answer GetRun(const Call& call);
Answer ListEvents(const Call& call);
Answer OpenStream(const Call& call);

}  // namespace selfcal::server
