#include "server/store/payload.h"

#include <fmt/format.h>
#include <zstd.h>

#include "proto/convert.h"
#include "server/store/checksum.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// Packed doubles gain little from more; this keeps up with the stream.
constexpr int kCompressionLevel = 3;
// Over what a segment within SegmentLimits can need, and under what a message
// can hold.
constexpr std::int64_t kMaxRawBytes = std::int64_t{1} << 30;

absl::Status Damaged(const std::string& what) {
  return absl::DataLossError(fmt::format(
      "{} is damaged: its data cannot be decoded; check the disk", what));
}

}  // namespace

absl::StatusOr<Payload> PackSegment(const MotionSegment& segment) {
  const v1::MotionSegment message = ToProto(segment);
  if (message.ByteSizeLong() > static_cast<std::size_t>(kMaxRawBytes)) {
    return absl::InvalidArgumentError(
        "the segment is over 1 GiB; send shorter segments");
  }
  const std::string raw = message.SerializeAsString();
  Payload payload;
  payload.raw_bytes = static_cast<std::int64_t>(raw.size());
  payload.data.resize(ZSTD_compressBound(raw.size()));
  const std::size_t size = ZSTD_compress(payload.data.data(),
                                         payload.data.size(),
                                         raw.data(),
                                         raw.size(),
                                         kCompressionLevel);
  if (ZSTD_isError(size)) {
    return absl::ResourceExhaustedError(
        fmt::format("cannot compress the segment: {}; try again later",
                    ZSTD_getErrorName(size)));
  }
  payload.data.resize(size);
  payload.sha256 = Sha256(payload.data);
  return payload;
}

absl::StatusOr<MotionSegment> UnpackSegment(const Payload& payload,
                                            const std::string& what) {
  SELFCAL_RETURN_IF_ERROR(VerifySha256(payload.data, payload.sha256, what));
  if (payload.raw_bytes < 0 || payload.raw_bytes > kMaxRawBytes) {
    return Damaged(what);
  }
  std::string raw(static_cast<std::size_t>(payload.raw_bytes), '\0');
  const std::size_t size = ZSTD_decompress(
      raw.data(), raw.size(), payload.data.data(), payload.data.size());
  v1::MotionSegment message;
  MotionSegment segment;
  if (ZSTD_isError(size) || size != raw.size() ||
      !message.ParseFromString(raw) ||
      !FromProto(message, "", &segment).empty()) {
    return Damaged(what);
  }
  return segment;
}

}  // namespace selfcal::server
