// Parts of the handlers under /api/v1; internal to server/console.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <string_view>
#include <vector>

#include "server/access/rules.h"
#include "server/console/api.h"

namespace selfcal::server {

// One request on its way; `parts` are what stands at the '*' of its pattern.
struct Call {
  const ApiContext& context;
  const HttpRequest& request;
  std::vector<std::string> parts;

  // Of the query; empty if it is not there.
  std::string Query(const std::string& name) const {
    const auto found = request.query.find(name);
    return found == request.query.end() ? "" : found->second;
  }
};

using Answer = absl::StatusOr<HttpResponse>;

// A number from 1 on in the query; `without` if it is not there.
// INVALID_ARGUMENT, with the rule, for anything else.
absl::StatusOr<int> CountOf(const Call& call,
                            const std::string& name,
                            int without,
                            std::string_view rule);

// Size and token; INVALID_ARGUMENT for a size that is no number.
absl::StatusOr<Page> PageOf(const Call& call);

// INVALID_ARGUMENT for what can be no id of a rig.
absl::StatusOr<std::string> RigOf(const Call& call);

// A version of the rig by number or "active"; INVALID_ARGUMENT for what is
// neither.
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
