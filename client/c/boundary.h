// The boundary of the C interface: exceptions and statuses become codes and
// messages, and structs of another version of the header become those of this
// one.
#pragma once

#include <absl/status/status.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <type_traits>

#include "client/c/selfcal.h"

namespace selfcal::c {

// Fills *error, unless it is null, and returns the code. Never throws.
std::int32_t Report(const absl::Status& status, selfcal_error* error) noexcept;
std::int32_t Report(std::int32_t code,
                    const char* message,
                    selfcal_error* error) noexcept;

// Runs the body, which returns an absl::Status and may throw.
template <typename Body>
std::int32_t Guarded(selfcal_error* error, const Body& body) noexcept {
  try {
    return Report(body(), error);
  } catch (const std::bad_alloc&) {
    return Report(SELFCAL_RESOURCE_EXHAUSTED, "out of memory", error);
  } catch (const std::exception& e) {
    return Report(SELFCAL_INTERNAL, e.what(), error);
  } catch (...) {
    return Report(SELFCAL_INTERNAL, "an unknown exception", error);
  }
}

// Returns what the body returns, or null if it throws.
template <typename Body>
auto OrNull(const Body& body) noexcept -> decltype(body()) {
  try {
    return body();
  } catch (...) {
    return nullptr;  // as documented: out of memory
  }
}

// INVALID_ARGUMENT for a null pointer; `name` is that of the argument.
absl::Status RequireNotNull(const void* pointer, const char* name);

// RESOURCE_EXHAUSTED if this is the first status of an object of the C++ client
// that has no memory: that has no message, and those of a daemon have one.
absl::Status CheckMemory(const absl::Status& first);

// INVALID_ARGUMENT unless a struct of `given` bytes can be converted to one of
// `known` bytes, of which the first version had `least`.
absl::Status CheckSize(const void* bytes,
                       std::uint32_t given,
                       std::size_t least,
                       std::size_t known,
                       const char* name);

// Copies a struct of the caller, which may be older or newer; members that it
// does not have are zero. `least` is the size of its first version.
template <typename Struct>
absl::Status Read(const Struct* given,
                  std::size_t least,
                  const char* name,
                  Struct* read) {
  static_assert(std::is_trivially_copyable_v<Struct>);
  if (auto status = RequireNotNull(given, name); !status.ok()) return status;
  const std::uint32_t size = given->struct_size;
  auto status = CheckSize(given, size, least, sizeof(Struct), name);
  if (!status.ok()) return status;
  *read = Struct{};
  std::memcpy(read, given, size < sizeof(Struct) ? size : sizeof(Struct));
  return absl::OkStatus();
}

// Fills a struct of the caller, which may be older or newer; members that this
// library does not know become zero.
template <typename Struct>
absl::Status Write(const Struct& value,
                   std::size_t least,
                   const char* name,
                   Struct* filled) {
  static_assert(std::is_trivially_copyable_v<Struct>);
  if (auto status = RequireNotNull(filled, name); !status.ok()) return status;
  const std::uint32_t size = filled->struct_size;
  // The contents of the caller's struct are not read.
  auto status = CheckSize(nullptr, size, least, sizeof(Struct), name);
  if (!status.ok()) return status;
  auto* bytes = reinterpret_cast<unsigned char*>(filled);
  const std::size_t shared = size < sizeof(Struct) ? size : sizeof(Struct);
  std::memcpy(bytes, &value, shared);
  if (size > shared) std::memset(bytes + shared, 0, size - shared);
  filled->struct_size = size;
  return absl::OkStatus();
}

// Size of the first version of each struct that may grow.
inline constexpr std::size_t kBuilderOptionsSize = 80;
inline constexpr std::size_t kBuilderStatisticsSize = 64;
inline constexpr std::size_t kClientOptionsSize = 88;
inline constexpr std::size_t kStreamStatisticsSize = 144;
inline constexpr std::size_t kImuSize = 136;
inline constexpr std::size_t kCameraSize = 184;
inline constexpr std::size_t kComponentSize = 40;

}  // namespace selfcal::c
