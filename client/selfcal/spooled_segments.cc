#include "client/selfcal/spooled_segments.h"

#include <absl/status/statusor.h>

#include <exception>
#include <filesystem>
#include <utility>

#include "proto/resource_names.h"

namespace selfcal::client {
namespace {

absl::StatusOr<std::unique_ptr<Spool>> OpenFolder(const ClientOptions& options,
                                                  const std::string& parent) {
  if (!ParseRigName(parent).has_value()) {
    return absl::InvalidArgumentError("no spool: the rig has no valid name");
  }
  return Spool::Open(std::filesystem::path(options.spool_dir) / options.rig,
                     options.max_spool_bytes);
}

}  // namespace

SpooledSegments SpooledSegments::Open(const ClientOptions& options) {
  SpooledSegments opened;
  opened.report_.opened = true;
  if (options.spool_dir.empty()) return opened;
  try {
    opened.parent_ = RigName(options.rig);
    auto spool = OpenFolder(options, opened.parent_);
    opened.report_.status = spool.status();
    if (spool.ok()) opened.spool_ = *std::move(spool);
  } catch (const std::exception&) {  // out of memory; a message needs memory
    opened.report_.status =
        absl::Status(absl::StatusCode::kResourceExhausted, "");
  }
  if (!opened.exists()) {
    ++opened.report_.failures;
    return opened;
  }
  opened.next_number_ = opened.spool_->next_number();
  opened.UpdateReport();
  opened.report_.recovered = opened.report_.segments;
  return opened;
}

bool SpooledSegments::Write(const EncodedSegment& segment) {
  const absl::Status status =
      spool_->Write(segment.number, segment.request->SerializeAsString());
  report_.status = status;
  if (status.ok()) {
    ++report_.spooled;
  } else {
    if (!absl::IsResourceExhausted(status)) ++report_.failures;
    Block();
  }
  UpdateReport();
  return status.ok();
}

std::optional<EncodedSegment> SpooledSegments::ReadUnloaded() {
  const std::uint64_t number = *spool_->FirstFrom(loaded_ + 1);
  const auto payload = spool_->Read(number);
  auto request = std::make_shared<v1::StreamSegmentsRequest>();
  absl::Status status = payload.status();
  if (status.ok() &&
      (!request->ParseFromString(*payload) || request->parent() != parent_)) {
    status = absl::DataLossError("a file of the spool is of another rig");
  }
  if (status.ok()) {
    SegmentKey key{request->segment().session(), request->segment().index()};
    return EncodedSegment{number, std::move(key), std::move(request), true};
  }
  report_.status = status;
  if (absl::IsDataLoss(status)) {
    spool_->Quarantine(number);
    ++report_.damaged;
  } else {
    ++report_.failures;
    Block();
  }
  UpdateReport();
  return std::nullopt;
}

void SpooledSegments::MarkLoaded(std::uint64_t number) {
  loaded_ = number;
  UpdateReport();
}

void SpooledSegments::Remove(const std::vector<std::uint64_t>& numbers) {
  for (const std::uint64_t number : numbers) spool_->Remove(number);
  retry_at_.reset();  // there is room again
  UpdateReport();
}

void SpooledSegments::RetryIfDue(Clock::time_point now) {
  if (retry_at_.has_value() && now >= *retry_at_) retry_at_.reset();
}

void SpooledSegments::UpdateReport() {
  report_.has_unloaded = spool_->FirstFrom(loaded_ + 1).has_value();
  report_.segments = spool_->size();
  report_.bytes = spool_->bytes();
}

}  // namespace selfcal::client
