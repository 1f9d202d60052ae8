#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/c/boundary.h"
#include "client/c/options.h"
#include "client/c/segment.h"
#include "client/c/selfcal.h"
#include "client/selfcal/client.h"

struct selfcal_stream {
  selfcal::client::SegmentStream stream;
};

namespace {

using selfcal::c::Guarded;
using selfcal::c::RequireNotNull;
using selfcal::client::Acknowledgement;

std::int32_t ToVerdict(Acknowledgement::Verdict verdict) {
  switch (verdict) {
    case Acknowledgement::Verdict::kStored:
      return SELFCAL_STORED;
    case Acknowledgement::Verdict::kDuplicate:
      return SELFCAL_DUPLICATE;
    case Acknowledgement::Verdict::kRejected:
      return SELFCAL_REJECTED;
  }
  return SELFCAL_REJECTED;
}

void CallBack(const Acknowledgement& ack,
              selfcal_ack_callback on_ack,
              void* user) {
  std::vector<selfcal_violation> violations;
  violations.reserve(ack.violations.size());
  for (const selfcal::Violation& violation : ack.violations) {
    violations.push_back({violation.field.c_str(), violation.message.c_str()});
  }
  const selfcal_acknowledgement given = {
      static_cast<std::uint32_t>(sizeof(selfcal_acknowledgement)),
      ToVerdict(ack.verdict),
      ack.key.session.c_str(),
      ack.key.index,
      violations.data(),
      violations.size(),
      ack.observations_dropped,
      ack.readings_dropped};
  on_ack(&given, user);
}

absl::Status Refusal(const selfcal::client::SegmentStream& stream) {
  std::string message =
      "the segment is dropped: the queue is full, or the stream has ended";
  for (const absl::Status& status :
       {stream.connection_status(), stream.spool_status()}) {
    if (!status.ok()) message += "; " + status.ToString();
  }
  return absl::ResourceExhaustedError(message);
}

}  // namespace

int32_t selfcal_stream_create(const selfcal_client_options* options,
                              selfcal_ack_callback on_ack,
                              void* user,
                              selfcal_stream** stream,
                              selfcal_error* error) {
  if (stream != nullptr) *stream = nullptr;
  return Guarded(error, [&] {
    const auto converted = selfcal::c::ToOptions(options);
    if (!converted.ok()) return converted.status();
    auto status = RequireNotNull(stream, "stream");
    if (!status.ok()) return status;
    selfcal::client::SegmentStream::AckCallback callback;
    if (on_ack != nullptr) {
      callback = [on_ack, user](const Acknowledgement& ack) {
        CallBack(ack, on_ack, user);
      };
    }
    std::unique_ptr<selfcal_stream> made(
        new selfcal_stream{{*converted, std::move(callback)}});
    status = selfcal::c::CheckMemory(made->stream.connection_status());
    if (status.ok()) *stream = made.release();
    return status;
  });
}

void selfcal_stream_destroy(selfcal_stream* stream) { delete stream; }

int32_t selfcal_stream_send(selfcal_stream* stream,
                            selfcal_segment* segment,
                            selfcal_error* error) {
  const std::unique_ptr<selfcal_segment> taken(segment);
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(stream, "stream"); !s.ok()) return s;
    if (auto s = RequireNotNull(segment, "segment"); !s.ok()) return s;
    if (stream->stream.Send(std::move(taken->closed))) return absl::OkStatus();
    return Refusal(stream->stream);
  });
}

int32_t selfcal_stream_drain(selfcal_stream* stream,
                             int64_t timeout_ms,
                             selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(stream, "stream"); !s.ok()) return s;
    return stream->stream.Drain(
        std::chrono::milliseconds(std::max<std::int64_t>(timeout_ms, 0)));
  });
}

int32_t selfcal_stream_get_statistics(const selfcal_stream* stream,
                                      selfcal_stream_statistics* statistics,
                                      selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(stream, "stream"); !s.ok()) return s;
    const auto counts = stream->stream.statistics();
    selfcal_stream_statistics value = {};
    value.queued = counts.queued;
    value.stored = counts.stored;
    value.duplicates = counts.duplicates;
    value.rejected = counts.rejected;
    value.dropped = counts.dropped;
    value.resent = counts.resent;
    value.connections = counts.connections;
    value.callback_failures = counts.callback_failures;
    value.tracks_triangulated = counts.tracks_triangulated;
    value.tracks_dropped = counts.tracks_dropped;
    value.observations_dropped = counts.observations_dropped;
    value.spooled = counts.spooled;
    value.spool_recovered = counts.spool_recovered;
    value.spool_damaged = counts.spool_damaged;
    value.spool_failures = counts.spool_failures;
    value.spool_segments = counts.spool_segments;
    value.spool_bytes = counts.spool_bytes;
    value.readings_dropped = counts.readings_dropped;
    return selfcal::c::Write(
        value, selfcal::c::kStreamStatisticsSize, "statistics", statistics);
  });
}

int32_t selfcal_stream_connection_status(const selfcal_stream* stream,
                                         selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(stream, "stream");
    return status.ok() ? stream->stream.connection_status() : status;
  });
}

int32_t selfcal_stream_spool_status(const selfcal_stream* stream,
                                    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(stream, "stream");
    return status.ok() ? stream->stream.spool_status() : status;
  });
}
