#include "server/encode/labels.h"

#include "proto/label_text.h"

namespace selfcal::server {
namespace {

constexpr int kMaxLabels = 64;

}  // namespace

std::vector<Violation> GetLabels(const v1::Rig& message,
                                 std::map<std::string, std::string>* labels) {
  std::vector<Violation> violations;
  if (message.labels_size() > kMaxLabels) {
    violations.push_back({"labels", "has more than 64 labels"});
  }
  for (const auto& [name, value] : message.labels()) {
    if (!IsLabelName(name)) {
      violations.push_back({"labels",
                            "has a name that is not 1 to 63 characters of a-z, "
                            "0-9, _ and -, beginning with a letter"});
    } else if (!IsLabelValue(value)) {
      violations.push_back(
          {"labels." + name, "is not at most 63 bytes of printable ASCII"});
    } else {
      labels->emplace(name, value);
    }
  }
  return violations;
}

}  // namespace selfcal::server
