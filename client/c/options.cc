#include "client/c/options.h"

#include <fmt/format.h>

#include <cmath>

#include "client/c/boundary.h"

namespace selfcal::c {
namespace {

template <typename Number>
absl::Status CheckNumber(Number value, const char* name) {
  if (std::isfinite(static_cast<double>(value)) && value >= 0) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      fmt::format("options.{}: is {}, must be at least 0", name, value));
}

absl::Status CheckText(const char* text, const char* name) {
  if (text != nullptr && *text != '\0') return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("options.{}: is required", name));
}

absl::Status CheckReserved(std::uint32_t reserved) {
  if (reserved == 0) return absl::OkStatus();
  return absl::InvalidArgumentError("options.reserved: must be 0");
}

// Returns the first that is not OK.
absl::Status First(std::initializer_list<absl::Status> statuses) {
  for (const absl::Status& status : statuses) {
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

// Sets what the caller has set; the rest keeps its default.
template <typename Number, typename Value>
void Set(Number given, Value* value) {
  if (given != 0) *value = static_cast<Value>(given);
}
void Set(const char* given, std::string* value) {
  if (given != nullptr) *value = given;
}
void Set(std::int64_t given_ms, std::chrono::milliseconds* value) {
  if (given_ms != 0) *value = std::chrono::milliseconds(given_ms);
}

}  // namespace

absl::StatusOr<client::ClientOptions> ToOptions(
    const selfcal_client_options* given) {
  selfcal_client_options read;
  absl::Status status = Read(given, kClientOptionsSize, "options", &read);
  if (!status.ok()) return status;
  status = First({CheckReserved(read.reserved),
                  CheckNumber(read.max_queue, "max_queue"),
                  CheckNumber(read.max_unacknowledged, "max_unacknowledged"),
                  CheckText(read.rig, "rig"),
                  CheckNumber(read.min_backoff_ms, "min_backoff_ms"),
                  CheckNumber(read.max_backoff_ms, "max_backoff_ms")});
  if (!status.ok()) return status;
  client::ClientOptions options;
  Set(read.target, &options.target);
  Set(read.rig, &options.rig);
  Set(read.max_queue, &options.max_queue);
  Set(read.max_unacknowledged, &options.max_unacknowledged);
  Set(read.min_backoff_ms, &options.min_backoff);
  Set(read.max_backoff_ms, &options.max_backoff);
  Set(read.ca_file, &options.ca_file);
  Set(read.certificate_file, &options.certificate_file);
  Set(read.key_file, &options.key_file);
  Set(read.spool_dir, &options.spool_dir);
  Set(read.max_spool_bytes, &options.max_spool_bytes);
  return options;
}

absl::StatusOr<client::SegmentBuilderOptions> ToOptions(
    const selfcal_builder_options* given) {
  selfcal_builder_options read;
  absl::Status status = Read(given, kBuilderOptionsSize, "options", &read);
  if (!status.ok()) return status;
  status = First({CheckNumber(read.keyframes, "keyframes"),
                  CheckNumber(read.min_observations, "min_observations"),
                  CheckNumber(read.min_keyframes, "min_keyframes"),
                  CheckText(read.session, "session"),
                  CheckNumber(read.first_index, "first_index"),
                  CheckNumber(read.calibration_version, "calibration_version"),
                  CheckNumber(read.seconds, "seconds"),
                  CheckNumber(read.max_gap_s, "max_gap_s"),
                  CheckNumber(read.pixel_sigma_px, "pixel_sigma_px"),
                  CheckNumber(read.gravity_mps2, "gravity_mps2"),
                  CheckReserved(read.reserved)});
  if (!status.ok()) return status;
  client::SegmentBuilderOptions options;
  Set(read.session, &options.session);
  Set(read.first_index, &options.first_index);
  Set(read.calibration_version, &options.calibration_version);
  Set(read.keyframes, &options.keyframes);
  Set(read.seconds, &options.seconds);
  Set(read.min_observations, &options.min_observations);
  Set(read.max_gap_s, &options.max_gap_s);
  Set(read.min_keyframes, &options.min_keyframes);
  Set(read.pixel_sigma_px, &options.pixel_sigma_px);
  Set(read.gravity_mps2, &options.gravity_mps2);
  if (read.session_start_ns != 0) {
    options.session_start_ns = read.session_start_ns;
  }
  options.new_ids_after_gap = read.same_ids_after_gap == 0;
  return options;
}

}  // namespace selfcal::c
