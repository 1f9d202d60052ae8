#include "proto/resource_names.h"

#include <charconv>
#include <system_error>

#include "proto/percent_encoding.h"

namespace selfcal {
namespace {

constexpr std::string_view kRigs = "rigs/";
constexpr std::string_view kSegments = "/segments/";
constexpr std::size_t kMaxRigId = 63;

bool IsRigId(std::string_view id) {
  const bool characters =
      id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-") == id.npos;
  return !id.empty() && id.size() <= kMaxRigId && characters;
}

// Accepts only what PercentEncode writes, so that a resource has exactly one
// name.
std::optional<std::string> Decode(std::string_view encoded) {
  auto text = PercentDecode(encoded);
  if (!text || text->empty() || PercentEncode(*text) != encoded) {
    return std::nullopt;
  }
  return text;
}

std::optional<std::int64_t> ParseIndex(std::string_view digits) {
  std::int64_t index = 0;
  const char* end = digits.data() + digits.size();
  const auto [rest, error] = std::from_chars(digits.data(), end, index);
  if (error != std::errc() || rest != end || index < 0) return std::nullopt;
  if (std::to_string(index) != digits) return std::nullopt;
  return index;
}

// Splits "rigs/{rig}{middle}{rest}"; the rest is not checked.
struct Split {
  std::string rig;
  std::string_view rest;
};
std::optional<Split> SplitName(std::string_view name, std::string_view middle) {
  if (!name.starts_with(kRigs)) return std::nullopt;
  name.remove_prefix(kRigs.size());
  const std::size_t slash = name.find('/');
  if (slash == name.npos) return std::nullopt;
  const std::string_view rig = name.substr(0, slash);
  name.remove_prefix(slash);
  if (!IsRigId(rig) || !name.starts_with(middle)) return std::nullopt;
  name.remove_prefix(middle.size());
  return Split{std::string(rig), name};
}

}  // namespace

std::string RigName(std::string_view rig) {
  return std::string(kRigs) + std::string(rig);
}

std::optional<std::string> ParseRigName(std::string_view name) {
  if (!name.starts_with(kRigs)) return std::nullopt;
  name.remove_prefix(kRigs.size());
  if (!IsRigId(name)) return std::nullopt;
  return std::string(name);
}

std::string SegmentName(std::string_view rig, const SegmentKey& key) {
  return RigName(rig) + std::string(kSegments) + PercentEncode(key.session) +
         '~' + std::to_string(key.index);
}

std::optional<SegmentNameParts> ParseSegmentName(std::string_view name) {
  const auto split = SplitName(name, kSegments);
  if (!split) return std::nullopt;
  const std::size_t tilde = split->rest.find('~');
  if (tilde == split->rest.npos) return std::nullopt;
  const auto session = Decode(split->rest.substr(0, tilde));
  const auto index = ParseIndex(split->rest.substr(tilde + 1));
  if (!session || !index) return std::nullopt;
  return SegmentNameParts{split->rig, {*session, *index}};
}

std::string ChildName(std::string_view rig,
                      std::string_view collection,
                      std::string_view id) {
  return RigName(rig) + '/' + std::string(collection) + '/' + PercentEncode(id);
}

std::optional<ChildNameParts> ParseChildName(std::string_view name,
                                             std::string_view collection) {
  const auto split = SplitName(name, '/' + std::string(collection) + '/');
  if (!split) return std::nullopt;
  const auto id = Decode(split->rest);
  if (!id) return std::nullopt;
  return ChildNameParts{split->rig, *id};
}

}  // namespace selfcal
