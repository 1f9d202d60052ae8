#include "client/cli/missing_rig.h"

#include <algorithm>
#include <chrono>

#include "client/text/text.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "proto/nearest_word.h"
#include "proto/safe_text.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

constexpr int kMostNames = 1000;
constexpr std::chrono::seconds kHintTime{2};

// Returns the rig in the name of the resource that was not found.
std::string RigThatWasNotFound(const grpc::Status& status) {
  constexpr std::string_view kRigs = "rigs/";
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return "";
  for (const auto& detail : details.details()) {
    google::rpc::ResourceInfo resource;
    if (!detail.Is<google::rpc::ResourceInfo>() ||
        !detail.UnpackTo(&resource) ||
        !resource.resource_name().starts_with(kRigs)) {
      continue;
    }
    const std::string rest = resource.resource_name().substr(kRigs.size());
    return rest.substr(0, rest.find('/'));
  }
  return "";
}

}  // namespace

std::vector<std::string> ReadRigNames(const Context& context,
                                      std::chrono::milliseconds time) {
  const auto stub = v1::RigService::NewStub(context.Channel());
  grpc::ClientContext call;
  call.set_deadline(std::chrono::system_clock::now() + time);
  v1::ListRigsRequest request;
  request.set_page_size(kMostNames);
  v1::ListRigsResponse rigs;
  std::vector<std::string> names;
  if (!stub->ListRigs(&call, request, &rigs).ok()) return names;
  for (const v1::Rig& rig : rigs.rigs()) names.push_back(LastPart(rig.name()));
  return names;
}

std::string MissingRigHint(const Context& context, const grpc::Status& status) {
  if (status.error_code() != grpc::StatusCode::NOT_FOUND) return "";
  const std::string rig = RigThatWasNotFound(status);
  if (rig.empty()) return "";
  const auto names = ReadRigNames(context, kHintTime);
  if (names.empty() ||
      std::find(names.begin(), names.end(), rig) != names.end()) {
    return "";
  }
  const std::string nearest = NearestWord(rig, names);
  if (!nearest.empty()) return "\n  Did you mean '" + SafeLine(nearest) + "'?";
  return "\n  'selfcal rig list' lists the rigs.";
}

}  // namespace selfcal::client
