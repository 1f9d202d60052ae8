#include "client/recording/decompress.h"

#include <absl/status/status.h>
#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

namespace selfcal::client {
namespace {

constexpr std::size_t kFirstBytes = std::size_t{64} << 10;

// One of the libraries, with its state.
class Stream {
 public:
  virtual ~Stream() = default;
  // Takes bytes from the front of *in, puts some to the front of [to, to +
  // *room), and takes their number from *room. Returns what is wrong, or null.
  virtual const char* Step(std::string_view* in,
                           char* to,
                           std::size_t* room) = 0;
};

class Lz4Stream : public Stream {
 public:
  Lz4Stream() { LZ4F_createDecompressionContext(&context_, LZ4F_VERSION); }
  ~Lz4Stream() override { LZ4F_freeDecompressionContext(context_); }

  const char* Step(std::string_view* in, char* to, std::size_t* room) override {
    std::size_t taken = in->size();
    std::size_t made = *room;
    const std::size_t code =
        LZ4F_decompress(context_, to, &made, in->data(), &taken, nullptr);
    if (LZ4F_isError(code)) return LZ4F_getErrorName(code);
    in->remove_prefix(taken);
    *room -= made;
    return nullptr;
  }

 private:
  LZ4F_dctx* context_ = nullptr;
};

class ZstdStream : public Stream {
 public:
  const char* Step(std::string_view* in, char* to, std::size_t* room) override {
    ZSTD_inBuffer input = {in->data(), in->size(), 0};
    ZSTD_outBuffer output = {to, *room, 0};
    const std::size_t code =
        ZSTD_decompressStream(context_.get(), &output, &input);
    if (ZSTD_isError(code)) return ZSTD_getErrorName(code);
    in->remove_prefix(input.pos);
    *room -= output.pos;
    return nullptr;
  }

 private:
  std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context_{
      ZSTD_createDCtx(), ZSTD_freeDCtx};
};

class Bzip2Stream : public Stream {
 public:
  Bzip2Stream() { BZ2_bzDecompressInit(&stream_, 0, 0); }
  ~Bzip2Stream() override { BZ2_bzDecompressEnd(&stream_); }

  const char* Step(std::string_view* in, char* to, std::size_t* room) override {
    if (ended_) return nullptr;
    stream_.next_in = const_cast<char*>(in->data());
    stream_.avail_in = static_cast<unsigned>(in->size());
    stream_.next_out = to;
    stream_.avail_out = static_cast<unsigned>(*room);
    const int code = BZ2_bzDecompress(&stream_);
    if (code != BZ_OK && code != BZ_STREAM_END) return "damaged bzip2 data";
    ended_ = code == BZ_STREAM_END;
    in->remove_prefix(in->size() - stream_.avail_in);
    *room = stream_.avail_out;
    return nullptr;
  }

 private:
  bz_stream stream_ = {};
  bool ended_ = false;
};

std::unique_ptr<Stream> MakeStream(Compression compression) {
  switch (compression) {
    case Compression::kLz4:
      return std::make_unique<Lz4Stream>();
    case Compression::kZstd:
      return std::make_unique<ZstdStream>();
    default:
      return std::make_unique<Bzip2Stream>();
  }
}

absl::Status WrongSize(std::size_t size) {
  return absl::DataLossError(
      fmt::format("the content is not of the {} bytes that are stated", size));
}

}  // namespace

absl::StatusOr<std::string> Decompress(Compression compression,
                                       std::string_view bytes,
                                       std::size_t size) {
  if (size > kMaxChunkBytes || bytes.size() > kMaxChunkBytes) {
    return absl::DataLossError(
        fmt::format("a chunk of {} bytes is larger than the {} allowed",
                    std::max(size, bytes.size()),
                    kMaxChunkBytes));
  }
  if (compression == Compression::kNone) {
    if (bytes.size() != size) return WrongSize(size);
    return std::string(bytes);
  }
  const auto stream = MakeStream(compression);
  std::string content;
  std::size_t filled = 0;
  // One byte more than stated, to see content that is longer.
  while (!bytes.empty() && filled <= size) {
    if (filled == content.size()) {
      content.resize(std::min(std::max(kFirstBytes, 2 * filled), size + 1));
    }
    const std::size_t before = bytes.size();
    std::size_t room = content.size() - filled;
    const std::size_t offered = room;
    const char* wrong = stream->Step(&bytes, content.data() + filled, &room);
    if (wrong != nullptr) return absl::DataLossError(wrong);
    filled += offered - room;
    if (bytes.size() == before && room == offered) break;
  }
  if (filled != size) return WrongSize(size);
  content.resize(size);
  return content;
}

}  // namespace selfcal::client
