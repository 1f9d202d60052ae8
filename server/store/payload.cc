#include "server/store/payload.h"

#include <fmt/format.h>
#include <zstd.h>

#include <array>
#include <memory>
#include <mutex>
#include <utility>

#include "proto/convert.h"
#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/record_parts.h"

namespace selfcal::server {
namespace {

// Level 3 compresses packed doubles 3 % better, but takes three times as long
// to write and to read.
constexpr int kCompressionLevel = -1;
// More than a segment within SegmentLimits can need, and less than a message
// can hold.
constexpr std::int64_t kMaxRawBytes = std::int64_t{1} << 30;

absl::Status Damaged(const std::string& what) {
  return absl::DataLossError(fmt::format(
      "{} is damaged: its data cannot be decoded; check the disk", what));
}

struct Free {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};
using Context = std::unique_ptr<ZSTD_CCtx, Free>;

// Pool of idle compression contexts, half a MB each: creating one takes as long
// as compressing a segment.
class Contexts {
 public:
  Context Take() {
    const std::lock_guard lock(mutex_);
    for (Context& context : kept_) {
      if (context != nullptr) return std::move(context);
    }
    return Context(ZSTD_createCCtx());
  }
  void Keep(Context context) {
    const std::lock_guard lock(mutex_);
    for (Context& place : kept_) {
      if (place == nullptr) return place.swap(context);
    }
  }

 private:
  std::mutex mutex_;
  std::array<Context, 4> kept_;
};

absl::StatusOr<std::string> Compress(const std::string& raw) {
  static Contexts& contexts = *new Contexts;  // outlives every thread
  Context context = contexts.Take();
  if (context == nullptr) {
    return absl::ResourceExhaustedError("memory is short: try again later");
  }
  std::string data(ZSTD_compressBound(raw.size()), '\0');
  const std::size_t size = ZSTD_compressCCtx(context.get(),
                                             data.data(),
                                             data.size(),
                                             raw.data(),
                                             raw.size(),
                                             kCompressionLevel);
  contexts.Keep(std::move(context));
  if (ZSTD_isError(size)) {
    return absl::ResourceExhaustedError(
        fmt::format("cannot compress the segment: {}; try again later",
                    ZSTD_getErrorName(size)));
  }
  data.resize(size);
  return data;
}

}  // namespace

absl::StatusOr<Payload> PackSegment(const MotionSegment& segment) {
  const v1::MotionSegment message = ToProto(segment);
  const std::size_t bytes = message.ByteSizeLong();
  if (bytes > static_cast<std::size_t>(kMaxRawBytes)) {
    return absl::InvalidArgumentError(
        "the segment is over 1 GiB; send shorter segments");
  }
  std::string raw(bytes, '\0');
  message.SerializeWithCachedSizesToArray(
      reinterpret_cast<std::uint8_t*>(raw.data()));
  Payload payload;
  payload.raw_bytes = static_cast<std::int64_t>(raw.size());
  SELFCAL_ASSIGN_OR_RETURN(payload.data, Compress(raw));
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
  if (ZSTD_isError(size) || size != raw.size()) return Damaged(what);
  v1::MotionSegment message;
  MotionSegment segment;
  if (!ParseStored(raw, &message) ||
      !FromProto(message, "", &segment).empty()) {
    return Damaged(what);
  }
  return segment;
}

}  // namespace selfcal::server
