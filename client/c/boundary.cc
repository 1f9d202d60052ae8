#include "client/c/boundary.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace selfcal::c {
namespace {

// Copies the text, cut between two characters of UTF-8.
void CopyMessage(std::string_view text, selfcal_error* error) {
  std::size_t size = std::min(text.size(), sizeof(error->message) - 1);
  if (size < text.size()) {
    while (size > 0 &&
           (static_cast<unsigned char>(text[size]) & 0xC0) == 0x80) {
      --size;
    }
  }
  text.copy(error->message, size);  // a view without text may be of null
  error->message[size] = '\0';
}

}  // namespace

std::int32_t Report(std::int32_t code,
                    const char* message,
                    selfcal_error* error) noexcept {
  if (error != nullptr) {
    error->code = code;
    CopyMessage(message, error);
  }
  return code;
}

std::int32_t Report(const absl::Status& status, selfcal_error* error) noexcept {
  const auto code = static_cast<std::int32_t>(status.code());
  if (error != nullptr) {
    error->code = code;
    CopyMessage({status.message().data(), status.message().size()}, error);
  }
  return code;
}

absl::Status RequireNotNull(const void* pointer, const char* name) {
  if (pointer != nullptr) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("{}: is NULL", name));
}

absl::Status CheckMemory(const absl::Status& first) {
  if (absl::IsResourceExhausted(first) && first.message().empty()) {
    return absl::ResourceExhaustedError("out of memory or threads");
  }
  return absl::OkStatus();
}

absl::Status CheckSize(const void* bytes,
                       std::uint32_t given,
                       std::size_t least,
                       std::size_t known,
                       const char* name) {
  // Much more than any struct will have: the member was not set.
  constexpr std::uint32_t kMaxSize = 64 << 10;
  if (given < least || given > kMaxSize) {
    return absl::InvalidArgumentError(
        fmt::format("{}: struct_size is {}, must be the sizeof of the struct, "
                    "{} in this version",
                    name,
                    given,
                    known));
  }
  if (bytes == nullptr || given <= known) return absl::OkStatus();
  const auto* begin = static_cast<const unsigned char*>(bytes);
  if (std::any_of(begin + known, begin + given, [](unsigned char byte) {
        return byte != 0;
      })) {
    return absl::InvalidArgumentError(
        fmt::format("{}: sets a member that this version of libselfcal does "
                    "not know; update the library",
                    name));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::c

const char* selfcal_version(void) { return SELFCAL_VERSION; }
