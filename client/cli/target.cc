#include "client/cli/target.h"

#include <fmt/format.h>

#include <string_view>

namespace selfcal::client {

absl::StatusOr<ClientOptions> Resolve(const Target& target) {
  constexpr std::string_view kInsecure = "insecure:";
  ClientOptions options;
  options.target = target.address;
  if (target.address.starts_with(kInsecure)) {
    options.target.erase(0, kInsecure.size());
    return options;
  }
  if (target.address.starts_with("unix:") ||
      target.address.starts_with("unix-abstract:")) {
    return options;
  }
  if (target.ca_file.empty() || target.certificate_file.empty() ||
      target.key_file.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "{} needs --ca, --cert and --key for mutual TLS; to connect without "
        "encryption, use insecure:{}",
        target.address,
        target.address));
  }
  options.ca_file = target.ca_file;
  options.certificate_file = target.certificate_file;
  options.key_file = target.key_file;
  return options;
}

}  // namespace selfcal::client
