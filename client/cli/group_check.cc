#include "client/cli/group_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <regex>

#include "proto/nearest_word.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

// Returns the groups in conditions such as "gain.camera >= 2" and
// "in_table = camera".
std::vector<std::string> NamedGroups(const std::string& text) {
  static const auto& pattern = *new std::regex(
      R"((?:^|\s)(?:(?:gain|entropy)\.|in_table\s*=\s*)([\w-]+))");
  std::vector<std::string> groups;
  for (std::sregex_iterator found(text.begin(), text.end(), pattern), end;
       found != end;
       ++found) {
    groups.push_back((*found)[1]);
  }
  return groups;
}

// Returns nullopt if the rig cannot be read.
std::optional<std::vector<std::string>> ReadGroups(const Context& context,
                                                   const std::string& rig) {
  using Service = v1::RigService::StubInterface;
  const auto stub = v1::RigService::NewStub(context.Channel());
  v1::GetRigRequest request;
  request.set_name(RigName(rig));
  v1::Rig found;
  if (!Call<Service>(stub.get(), &Service::GetRig, request, &found).ok()) {
    return std::nullopt;
  }
  std::vector<std::string> groups;
  for (const auto& group : found.groups()) groups.push_back(group.group());
  return groups;
}

}  // namespace

absl::Status CheckGroup(const Context& context,
                        const std::string& rig,
                        const GivenFlag& given) {
  const auto known = ReadGroups(context, rig);
  if (!known ||
      std::find(known->begin(), known->end(), given.text) != known->end()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      fmt::format("{}: the rig has no group '{}'{}\n  Known: {}",
                  given.flag,
                  given.text,
                  DidYouMean(given.text, *known),
                  fmt::join(*known, ", ")));
}

absl::Status CheckGroups(const Context& context,
                         const std::string& rig,
                         const std::vector<GivenFlag>& given) {
  for (const GivenFlag& one : given) {
    for (const std::string& group : NamedGroups(one.text)) {
      absl::Status status = CheckGroup(context, rig, {one.flag, group});
      if (!status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

}  // namespace selfcal::client
