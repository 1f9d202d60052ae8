#include "server/console/api.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <new>
#include <optional>
#include <utility>

#include "server/console/call.h"
#include "server/console/json.h"

namespace selfcal::server {
namespace {

struct Route {
  std::string_view method;
  std::string_view pattern;  // '*' matches one part of the path
  Answer (*handler)(const Call&);
};

constexpr Route kRoutes[] = {
    {"GET", "session", GetSession},
    {"GET", "events", ListEvents},
    {"GET", "stream", OpenStream},
    {"GET", "rigs", ListRigs},
    {"GET", "rigs/*", GetRig},
    {"GET", "rigs/*/tables", ListTables},
    {"GET", "rigs/*/segments", ListSegments},
    {"GET", "rigs/*/segments/*", GetSegment},
    {"GET", "rigs/*/segments/*/data", GetSegmentData},
    {"GET", "rigs/*/segments/*/absences", ListAbsences},
    {"GET", "rigs/*/segments/*/information", GetInformation},
    {"GET", "rigs/*/segments/*/residuals", GetResiduals},
    {"GET", "rigs/*/sessions", ListSessions},
    {"GET", "rigs/*/sessions/*/trajectory", GetTrajectory},
    {"GET", "rigs/*/calibrations", ListCalibrations},
    {"GET", "rigs/*/calibrations/*", GetCalibration},
    {"POST", "rigs/*/calibrations/*", ActivateCalibration},
    {"GET", "rigs/*/compare", CompareCalibrations},
    {"GET", "rigs/*/coach", AdviseMotion},
    {"GET", "rigs/*/recalibrations", ListRuns},
    {"GET", "rigs/*/recalibrations/*", GetRun},
    {"GET", "rigs/*/events", ListEvents},
};

std::string_view NextPart(std::string_view* path) {
  const std::size_t slash = path->find('/');
  const std::string_view part = path->substr(0, slash);
  *path = slash == path->npos ? "" : path->substr(slash + 1);
  return part;
}

// Returns the parts of the path at each '*'; nullopt if it does not match.
std::optional<std::vector<std::string>> Match(std::string_view pattern,
                                              std::string_view path) {
  std::vector<std::string> parts;
  while (!pattern.empty()) {
    if (path.empty()) return std::nullopt;
    const std::string_view wanted = NextPart(&pattern);
    const std::string_view part = NextPart(&path);
    if (wanted == "*") {
      if (part.empty()) return std::nullopt;
      parts.emplace_back(part);
    } else if (wanted != part) {
      return std::nullopt;
    }
  }
  if (!path.empty()) return std::nullopt;
  return parts;
}

HttpResponse Dispatch(const ApiContext& context, const HttpRequest& request) {
  constexpr std::string_view kPrefix = "/api/v1/";
  std::string_view path = request.path;
  path.remove_prefix(path.starts_with(kPrefix) ? kPrefix.size() : path.size());
  const std::string_view method =
      request.method == "HEAD" ? "GET" : std::string_view(request.method);
  bool known = false;
  for (const Route& route : kRoutes) {
    auto parts = Match(route.pattern, path);
    if (!parts) continue;
    known = true;
    if (route.method != method) continue;
    auto answer = route.handler({context, request, *std::move(parts)});
    return answer.ok() ? *std::move(answer) : ErrorResponse(answer.status());
  }
  if (known) {
    return ErrorResponse(absl::UnimplementedError(
        "this address does not support the method " + request.method));
  }
  return ErrorResponse(absl::NotFoundError(
      "no such address; docs/console.md lists the addresses"));
}

}  // namespace

HttpResponse AnswerApi(const ApiContext& context, const HttpRequest& request) {
  try {
    return Dispatch(context, request);
  } catch (const std::bad_alloc&) {
    return ErrorResponse(absl::ResourceExhaustedError("out of memory"));
  } catch (const std::exception& error) {
    spdlog::error("console: {}", error.what());
    return ErrorResponse(
        absl::InternalError("internal error; see the daemon's log"));
  }
}

}  // namespace selfcal::server
