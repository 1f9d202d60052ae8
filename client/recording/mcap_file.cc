#include "client/recording/mcap_file.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "client/recording/chunked_file.h"
#include "client/recording/damage.h"

namespace selfcal::client {
namespace {

// Schemas contain the definition of a message, channels their metadata.
constexpr std::uint64_t kMaxDefinitionBytes = 16 << 20;
// Bytes of a message before its data: channel, sequence, and two times.
constexpr std::uint64_t kMessageHeaderBytes = 2 + 4 + 8 + 8;
// Bytes of a chunk before the name of its compression: two times, size,
// checksum.
constexpr std::uint64_t kChunkHeaderBytes = 8 + 8 + 8 + 4;

// Opcode and size of any record.
constexpr std::uint64_t kRecordHeadBytes = 1 + 8;
// The last record, before the magic bytes: two offsets, and a checksum.
constexpr std::uint64_t kFooterBytes = kRecordHeadBytes + 8 + 8 + 4;

enum Opcode : unsigned char {
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kDataEnd = 15,
};

std::optional<Compression> CompressionNamed(std::string_view name) {
  if (name.empty()) return Compression::kNone;
  if (name == "lz4") return Compression::kLz4;
  if (name == "zstd") return Compression::kZstd;
  return {};
}

std::optional<Wire> WireNamed(std::string_view encoding) {
  if (encoding == "cdr") return Wire::kCdr;
  if (encoding == "ros1") return Wire::kRos1;
  return {};
}

absl::Status Misses(std::string_view what) {
  return absl::DataLossError(fmt::format("{} is cut off", what));
}

class McapFile : public MessageFile {
 public:
  McapFile(std::unique_ptr<InputFile> file, std::uint64_t begin)
      : file_(std::move(file)), begin_(begin) {}

  absl::Status Scan(const Visitor& visit,
                    std::vector<std::string>* problems) override {
    Damage damage(file_.file().path());
    const std::uint64_t size = file_.file().size();
    ReadSummary();
    Range file{RecordCursor(&file_.file(), begin_, size)};
    const absl::Status read = ReadRecords(&file, visit, &damage);
    if (!read.ok()) {
      damage.CutOff(file.cursor.at(), size, read);
    } else if (!ended_) {
      damage.CutOff(size, size, absl::DataLossError("it has no end of data"));
    }
    damage.Report(problems);
    return absl::OkStatus();
  }

  absl::StatusOr<std::string_view> Read(const MessagePlace& place,
                                        std::size_t max_size) override {
    return file_.Read(place, max_size);
  }

 private:
  // Records of the file, or of one of its chunks.
  struct Range {
    RecordCursor cursor;
    bool is_chunk = false;
    std::int32_t chunk = -1;  // its number, if it is compressed
  };
  struct Channel {
    MessageTopic topic;
    bool is_readable = false;
  };

  absl::Status ReadRecords(Range* range, const Visitor& visit, Damage* damage) {
    while (range->cursor.left() > 0 && !ended_) {
      const absl::Status read = ReadRecord(range, visit, damage);
      if (!read.ok()) return read;
    }
    return absl::OkStatus();
  }

  // The summary repeats the definitions, of which the only ones elsewhere may
  // be in a chunk that is damaged. It may be missing.
  void ReadSummary() {
    const std::uint64_t size = file_.file().size();
    if (size < begin_ + kFooterBytes + begin_) return;
    const std::uint64_t footer = size - begin_ - kFooterBytes;
    RecordCursor end(&file_.file(), footer, size);
    const auto record = end.Take(kRecordHeadBytes + 8);
    if (!record.ok() || (*record)[0] != kFooter) return;
    const auto begin =
        LittleEndian<std::uint64_t>(record->substr(kRecordHeadBytes));
    if (begin < begin_ || begin > footer) return;
    RecordCursor cursor(&file_.file(), begin, footer);
    while (cursor.left() > 0) {
      const auto head = TakeHead(&cursor);
      if (!head.ok()) return;
      const absl::Status read =
          head->opcode == kSchema || head->opcode == kChannel
              ? ReadDefinition(*head, &cursor)
              : cursor.Skip(head->size);
      if (!read.ok()) return;
    }
  }

  struct Head {
    unsigned char opcode;
    std::uint64_t size;
  };
  static absl::StatusOr<Head> TakeHead(RecordCursor* cursor) {
    const auto bytes = cursor->Take(kRecordHeadBytes);
    if (!bytes.ok()) return bytes.status();
    return Head{static_cast<unsigned char>((*bytes)[0]),
                LittleEndian<std::uint64_t>(bytes->substr(1))};
  }

  absl::Status ReadDefinition(const Head& head, RecordCursor* cursor) {
    if (head.size > kMaxDefinitionBytes) {
      return absl::DataLossError(
          fmt::format("a definition of {} bytes", head.size));
    }
    const auto bytes = cursor->Take(head.size);
    if (!bytes.ok()) return bytes.status();
    return head.opcode == kSchema ? AddSchema(*bytes) : AddChannel(*bytes);
  }

  absl::Status ReadRecord(Range* range, const Visitor& visit, Damage* damage) {
    RecordCursor& cursor = range->cursor;
    const auto head = TakeHead(&cursor);
    if (!head.ok()) return head.status();
    const std::uint64_t size = head->size;
    switch (head->opcode) {
      case kMessage:
        return VisitMessage(range, size, visit);
      case kSchema:
      case kChannel:
        return ReadDefinition(*head, &cursor);
      case kChunk:
        if (range->is_chunk) {
          return absl::DataLossError("a chunk is in another one");
        }
        return ReadChunk(&cursor, size, visit, damage);
      case kDataEnd:
        ended_ = !range->is_chunk;
        return cursor.Skip(size);
      default:
        return cursor.Skip(size);
    }
  }

  // A string whose length of four bytes is before it.
  static std::optional<std::string> TakeText(std::string_view* bytes) {
    if (bytes->size() < 4) return {};
    const std::uint32_t size = LittleEndian<std::uint32_t>(*bytes);
    bytes->remove_prefix(4);
    if (size > bytes->size()) return {};
    const std::string text(bytes->substr(0, size));
    bytes->remove_prefix(size);
    return text;
  }

  absl::Status AddSchema(std::string_view bytes) {
    if (bytes.size() < 2) return Misses("a schema");
    const auto id = LittleEndian<std::uint16_t>(bytes);
    bytes.remove_prefix(2);
    const auto name = TakeText(&bytes);
    if (!name) return Misses("a schema");
    types_[id] = *name;
    return absl::OkStatus();
  }

  absl::Status AddChannel(std::string_view bytes) {
    if (bytes.size() < 4) return Misses("a channel");
    const auto id = LittleEndian<std::uint16_t>(bytes);
    const auto schema = LittleEndian<std::uint16_t>(bytes.substr(2));
    bytes.remove_prefix(4);
    const auto topic = TakeText(&bytes);
    const auto encoding = topic ? TakeText(&bytes) : std::nullopt;
    if (!encoding) return Misses("a channel");
    const auto wire = WireNamed(*encoding);
    const auto type = types_.find(schema);
    Channel& channel = channels_[id];
    channel.is_readable = wire && type != types_.end();
    if (channel.is_readable) {
      channel.topic = {*topic, RosTypeName(type->second), *wire};
    }
    return absl::OkStatus();
  }

  absl::Status VisitMessage(Range* range,
                            std::uint64_t size,
                            const Visitor& visit) {
    if (size < kMessageHeaderBytes || size > kMaxChunkBytes) {
      return absl::DataLossError(fmt::format("a message of {} bytes", size));
    }
    const auto id = range->cursor.Take(2);
    if (!id.ok()) return id.status();
    const auto channel = channels_.find(LittleEndian<std::uint16_t>(*id));
    absl::Status skipped = range->cursor.Skip(kMessageHeaderBytes - 2);
    if (!skipped.ok()) return skipped;
    const MessagePlace place = {
        range->chunk,
        static_cast<std::uint32_t>(size - kMessageHeaderBytes),
        range->cursor.at()};
    skipped = range->cursor.Skip(place.size);
    if (skipped.ok() && channel != channels_.end() &&
        channel->second.is_readable) {
      visit(channel->second.topic, place);
    }
    return skipped;
  }

  absl::Status ReadChunk(RecordCursor* cursor,
                         std::uint64_t size,
                         const Visitor& visit,
                         Damage* damage) {
    const std::uint64_t begin = cursor->at();
    const bool is_whole = size <= cursor->left();
    const std::uint64_t end = begin + std::min(size, cursor->left());
    const absl::Status read =
        ReadChunkContent(begin, end, is_whole, visit, damage);
    // That the file ends within the chunk is reported once, for the file.
    if (!read.ok() && is_whole) damage->Chunk(begin, read);
    return cursor->Skip(size);
  }

  absl::Status ReadChunkContent(std::uint64_t begin,
                                std::uint64_t end,
                                bool is_whole,
                                const Visitor& visit,
                                Damage* damage) {
    RecordCursor head(&file_.file(), begin, end);
    auto bytes = head.Take(kChunkHeaderBytes + 4);
    if (!bytes.ok()) return bytes.status();
    const auto size = LittleEndian<std::uint64_t>(bytes->substr(16));
    const auto crc32 = LittleEndian<std::uint32_t>(bytes->substr(24));
    bytes = head.Take(LittleEndian<std::uint32_t>(bytes->substr(28)));
    if (!bytes.ok()) return bytes.status();
    const auto compression = CompressionNamed(*bytes);
    bytes = head.Take(8);
    if (!bytes.ok()) return bytes.status();
    const auto compressed_size = LittleEndian<std::uint64_t>(*bytes);
    const std::uint64_t at = head.at();
    if (!compression) return absl::DataLossError("its compression is unknown");
    if (*compression == Compression::kNone) {
      Range chunk{
          RecordCursor(&file_.file(), at, at + std::min(size, end - at)), true};
      return ReadRecords(&chunk, visit, damage);
    }
    if (!is_whole) return absl::OkStatus();
    if (compressed_size > end - at) return Misses("its content");
    std::int32_t number = 0;
    const auto content = file_.AddChunk(
        {at,
         compressed_size,
         size,
         *compression,
         crc32 == 0 ? std::nullopt : std::optional<std::uint32_t>(crc32)},
        &number);
    if (!content.ok()) return content.status();
    Range chunk{RecordCursor(**content), true, number};
    return ReadRecords(&chunk, visit, damage);
  }

  ChunkedFile file_;
  const std::uint64_t begin_;
  bool ended_ = false;                          // the data, before the summary
  std::map<std::uint16_t, std::string> types_;  // by schema
  std::map<std::uint16_t, Channel> channels_;
};

}  // namespace

std::unique_ptr<MessageFile> MakeMcapFile(std::unique_ptr<InputFile> file,
                                          std::uint64_t begin) {
  return std::make_unique<McapFile>(std::move(file), begin);
}

}  // namespace selfcal::client
