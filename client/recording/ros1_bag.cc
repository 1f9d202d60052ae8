#include "client/recording/ros1_bag.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "client/recording/chunked_file.h"
#include "client/recording/damage.h"

namespace selfcal::client {
namespace {

// The definition of a message is in its connection.
constexpr std::uint32_t kMaxHeaderBytes = 1 << 20;
constexpr std::uint32_t kMaxConnectionBytes = 16 << 20;

enum Op : unsigned char { kOpMessage = 2, kOpChunk = 5, kOpConnection = 7 };

using Fields = std::map<std::string, std::string, std::less<>>;

// "name=value", each with its length before it.
absl::StatusOr<Fields> ParseFields(std::string_view bytes) {
  Fields fields;
  while (!bytes.empty()) {
    if (bytes.size() < 4) return absl::DataLossError("a field is cut off");
    const std::uint32_t size = LittleEndian<std::uint32_t>(bytes);
    bytes.remove_prefix(4);
    const std::string_view field = bytes.substr(0, size);
    const std::size_t equals = field.find('=');
    if (size > bytes.size() || equals == std::string_view::npos) {
      return absl::DataLossError("a field has no value");
    }
    fields.emplace(field.substr(0, equals), field.substr(equals + 1));
    bytes.remove_prefix(size);
  }
  return fields;
}

template <typename T>
std::optional<T> Number(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end() || found->second.size() != sizeof(T)) return {};
  return LittleEndian<T>(found->second);
}

std::string Text(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  return found == fields.end() ? std::string() : found->second;
}

std::optional<Compression> CompressionNamed(const std::string& name) {
  if (name == "none") return Compression::kNone;
  if (name == "lz4") return Compression::kLz4;
  if (name == "bz2") return Compression::kBzip2;
  return {};
}

class Ros1Bag : public MessageFile {
 public:
  Ros1Bag(std::unique_ptr<InputFile> file, std::uint64_t begin)
      : file_(std::move(file)), begin_(begin) {}

  absl::Status Scan(const Visitor& visit,
                    std::vector<std::string>* problems) override {
    Damage damage(file_.file().path());
    const std::uint64_t size = file_.file().size();
    ReadIndex();
    Range file{RecordCursor(&file_.file(), begin_, size)};
    const absl::Status read = ReadRecords(&file, visit, &damage);
    if (!read.ok()) damage.CutOff(file.cursor.at(), size, read);
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

  absl::Status ReadRecords(Range* range, const Visitor& visit, Damage* damage) {
    while (range->cursor.left() > 0) {
      const absl::Status read = ReadRecord(range, visit, damage);
      if (!read.ok()) return read;
    }
    return absl::OkStatus();
  }

  // The index repeats the connections, of which the only ones elsewhere may be
  // in a chunk that is damaged. It is missing in a bag that was not closed.
  void ReadIndex() {
    const std::uint64_t size = file_.file().size();
    RecordCursor first(&file_.file(), begin_, size);
    const auto bag = TakeHead(&first);
    if (!bag.ok()) return;
    const auto begin = Number<std::uint64_t>(bag->fields, "index_pos");
    if (!begin || *begin < begin_ || *begin > size) return;
    RecordCursor cursor(&file_.file(), *begin, size);
    while (cursor.left() > 0) {
      const auto head = TakeHead(&cursor);
      if (!head.ok()) return;
      const absl::Status read =
          head->op == kOpConnection
              ? AddConnection(head->fields, &cursor, head->size)
              : cursor.Skip(head->size);
      if (!read.ok()) return;
    }
  }

  // A record up to its data.
  struct Head {
    std::uint8_t op;
    Fields fields;
    std::uint32_t size;  // of the data
  };
  static absl::StatusOr<Head> TakeHead(RecordCursor* cursor) {
    auto size = TakeSize(cursor);
    if (!size.ok()) return size.status();
    if (*size > kMaxHeaderBytes) {
      return absl::DataLossError(fmt::format("a header of {} bytes", *size));
    }
    const auto header = cursor->Take(*size);
    if (!header.ok()) return header.status();
    auto fields = ParseFields(*header);
    if (!fields.ok()) return fields.status();
    size = TakeSize(cursor);
    if (!size.ok()) return size.status();
    const auto op = Number<std::uint8_t>(*fields, "op").value_or(0);
    return Head{op, *std::move(fields), *size};
  }

  absl::Status ReadRecord(Range* range, const Visitor& visit, Damage* damage) {
    RecordCursor& cursor = range->cursor;
    const auto head = TakeHead(&cursor);
    if (!head.ok()) return head.status();
    switch (head->op) {
      case kOpMessage:
        return VisitMessage(head->fields, range, head->size, visit);
      case kOpConnection:
        return AddConnection(head->fields, &cursor, head->size);
      case kOpChunk:
        if (range->is_chunk) {
          return absl::DataLossError("a chunk is in another one");
        }
        return ReadChunk(head->fields, &cursor, head->size, visit, damage);
      default:
        return cursor.Skip(head->size);
    }
  }

  static absl::StatusOr<std::uint32_t> TakeSize(RecordCursor* cursor) {
    const auto bytes = cursor->Take(4);
    if (!bytes.ok()) return bytes.status();
    return LittleEndian<std::uint32_t>(*bytes);
  }

  absl::Status VisitMessage(const Fields& fields,
                            Range* range,
                            std::uint32_t size,
                            const Visitor& visit) {
    const auto connection = Number<std::uint32_t>(fields, "conn");
    const auto topic = connection ? topics_.find(*connection) : topics_.end();
    const MessagePlace place = {range->chunk, size, range->cursor.at()};
    const absl::Status skipped = range->cursor.Skip(size);
    if (skipped.ok() && topic != topics_.end()) visit(topic->second, place);
    return skipped;
  }

  absl::Status AddConnection(const Fields& fields,
                             RecordCursor* cursor,
                             std::uint32_t size) {
    const auto connection = Number<std::uint32_t>(fields, "conn");
    if (!connection || size > kMaxConnectionBytes) {
      return absl::DataLossError("a connection is damaged");
    }
    const auto bytes = cursor->Take(size);
    if (!bytes.ok()) return bytes.status();
    const auto more = ParseFields(*bytes);
    if (!more.ok()) return more.status();
    topics_.insert_or_assign(
        *connection,
        MessageTopic{Text(fields, "topic"), Text(*more, "type"), Wire::kRos1});
    return absl::OkStatus();
  }

  absl::Status ReadChunk(const Fields& fields,
                         RecordCursor* cursor,
                         std::uint32_t size,
                         const Visitor& visit,
                         Damage* damage) {
    const std::uint64_t begin = cursor->at();
    const std::uint64_t present = std::min<std::uint64_t>(size, cursor->left());
    const auto compression = CompressionNamed(Text(fields, "compression"));
    const auto content_size = Number<std::uint32_t>(fields, "size");
    absl::Status read;
    if (!compression || !content_size) {
      read = absl::DataLossError("its header is damaged");
    } else if (*compression == Compression::kNone) {
      Range chunk{RecordCursor(&file_.file(), begin, begin + present), true};
      read = ReadRecords(&chunk, visit, damage);
    } else if (present == size) {
      std::int32_t number = 0;
      const auto content = file_.AddChunk(
          {begin, size, *content_size, *compression, {}}, &number);
      read = content.status();
      if (read.ok()) {
        Range chunk{RecordCursor(**content), true, number};
        read = ReadRecords(&chunk, visit, damage);
      }
    }
    // That the file ends within the chunk is reported once, for the file.
    if (!read.ok() && present == size) damage->Chunk(begin, read);
    return cursor->Skip(size);
  }

  ChunkedFile file_;
  const std::uint64_t begin_;
  std::map<std::uint32_t, MessageTopic> topics_;  // by connection
};

}  // namespace

std::unique_ptr<MessageFile> MakeRos1Bag(std::unique_ptr<InputFile> file,
                                         std::uint64_t begin) {
  return std::make_unique<Ros1Bag>(std::move(file), begin);
}

}  // namespace selfcal::client
