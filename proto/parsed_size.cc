#include "proto/parsed_size.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message.h>
#include <google/protobuf/unknown_field_set.h>
#include <google/protobuf/wire_format_lite.h>

#include <limits>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

namespace selfcal {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::MessageFactory;
using google::protobuf::UnknownField;
using google::protobuf::UnknownFieldSet;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

// Overhead of an element that is allocated by itself: its pointer in a list
// that grows twofold, and the header of its allocation.
constexpr std::int64_t kOfElement = 2 * sizeof(void*) + 16;
constexpr std::int64_t kOfString = kOfElement + sizeof(std::string);
constexpr std::int64_t kOfUnknown =
    2 * sizeof(UnknownField) + sizeof(UnknownFieldSet) + kOfString;
// Depth to which protobuf parses.
constexpr int kMaxDepth = 100;

// The fields of one type of message, by number.
struct TypeLayout {
  struct Field {
    bool is_known = false;
    WireFormatLite::WireType wire_type = WireFormatLite::WIRETYPE_VARINT;
    const Descriptor* message = nullptr;
    // Memory of an element of a list of numbers, which grows twofold.
    std::int64_t number_bytes = 0;
    std::int64_t least_wire_bytes = 1;
  };
  std::int64_t empty_bytes = 0;
  std::vector<Field> fields;

  explicit TypeLayout(const Descriptor& type)
      : empty_bytes(
            static_cast<std::int64_t>(MessageFactory::generated_factory()
                                          ->GetPrototype(&type)
                                          ->SpaceUsedLong())) {
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      const auto number = static_cast<std::size_t>(field.number());
      if (fields.size() <= number) fields.resize(number + 1);
      Field& known = fields[number];
      known.is_known = true;
      known.wire_type = WireFormatLite::WireTypeForFieldType(
          static_cast<WireFormatLite::FieldType>(field.type()));
      known.message = field.message_type();
      if (!field.is_packable()) continue;
      known.number_bytes = 2 * SizeOf(field.cpp_type());
      switch (known.wire_type) {
        case WireFormatLite::WIRETYPE_FIXED64:
          known.least_wire_bytes = 8;
          break;
        case WireFormatLite::WIRETYPE_FIXED32:
          known.least_wire_bytes = 4;
          break;
        default:
          break;
      }
    }
  }

 private:
  static std::int64_t SizeOf(FieldDescriptor::CppType type) {
    switch (type) {
      case FieldDescriptor::CPPTYPE_INT64:
      case FieldDescriptor::CPPTYPE_UINT64:
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return 8;
      default:
        return 4;
    }
  }
};

class Counter {
 public:
  explicit Counter(CodedInputStream* in) : in_(in) {}

  // Counts a message up to the limit of the stream; false where it cannot be
  // read.
  bool Add(const Descriptor& type, int depth) {
    const TypeLayout& layout = LayoutOf(type);
    bytes_ += layout.empty_bytes;
    int groups = 0;  // that are open
    while (const std::uint32_t tag = in_->ReadTag()) {
      switch (WireFormatLite::GetTagWireType(tag)) {
        case WireFormatLite::WIRETYPE_START_GROUP:
          ++groups;
          bytes_ += kOfUnknown;
          break;
        case WireFormatLite::WIRETYPE_END_GROUP:
          --groups;
          break;
        default:
          // Nothing within a group is known: the contract has none.
          if (!AddField(groups > 0 ? Unknown() : FieldOf(layout, tag),
                        WireFormatLite::GetTagWireType(tag),
                        depth)) {
            return false;
          }
      }
    }
    return in_->ConsumedEntireMessage();
  }

  std::int64_t bytes() const { return bytes_; }

 private:
  const TypeLayout& LayoutOf(const Descriptor& type) {
    std::unique_ptr<TypeLayout>& layout = layouts_[&type];
    if (layout == nullptr) layout = std::make_unique<TypeLayout>(type);
    return *layout;
  }

  static const TypeLayout::Field& Unknown() {
    static const TypeLayout::Field kUnknown;
    return kUnknown;
  }

  // A field of another form than the contract's is not known.
  static const TypeLayout::Field& FieldOf(const TypeLayout& layout,
                                          std::uint32_t tag) {
    const auto number =
        static_cast<std::size_t>(WireFormatLite::GetTagFieldNumber(tag));
    if (number >= layout.fields.size()) return Unknown();
    const TypeLayout::Field& field = layout.fields[number];
    const auto form = WireFormatLite::GetTagWireType(tag);
    const bool is_packed = field.number_bytes > 0 &&
                           form == WireFormatLite::WIRETYPE_LENGTH_DELIMITED;
    return form == field.wire_type || is_packed ? field : Unknown();
  }

  bool AddField(const TypeLayout::Field& field,
                WireFormatLite::WireType form,
                int depth) {
    if (!field.is_known) bytes_ += kOfUnknown;
    std::uint64_t varint = 0;
    switch (form) {
      case WireFormatLite::WIRETYPE_VARINT:
        bytes_ += field.number_bytes;
        return in_->ReadVarint64(&varint);
      case WireFormatLite::WIRETYPE_FIXED64:
        bytes_ += field.number_bytes;
        return in_->Skip(8);
      case WireFormatLite::WIRETYPE_FIXED32:
        bytes_ += field.number_bytes;
        return in_->Skip(4);
      case WireFormatLite::WIRETYPE_LENGTH_DELIMITED:
        return AddDelimited(field, depth);
      default:
        return false;
    }
  }

  bool AddDelimited(const TypeLayout::Field& field, int depth) {
    std::uint32_t length = 0;
    if (!in_->ReadVarint32(&length) ||
        length > static_cast<std::uint32_t>(
                     std::numeric_limits<std::int32_t>::max())) {
      return false;
    }
    if (field.message != nullptr) {
      if (depth == kMaxDepth) return false;
      bytes_ += kOfElement;
      const auto limit = in_->PushLimit(static_cast<int>(length));
      const bool is_read = Add(*field.message, depth + 1);
      in_->PopLimit(limit);
      return is_read;
    }
    bytes_ += field.number_bytes > 0
                  ? field.number_bytes * length / field.least_wire_bytes
                  : kOfString + length;
    return in_->Skip(static_cast<int>(length));
  }

  CodedInputStream* const in_;
  std::int64_t bytes_ = 0;
  std::unordered_map<const Descriptor*, std::unique_ptr<TypeLayout>> layouts_;
};

}  // namespace

std::int64_t ParsedSize(const Descriptor& type,
                        google::protobuf::io::ZeroCopyInputStream* bytes) {
  CodedInputStream in(bytes);
  in.SetTotalBytesLimit(std::numeric_limits<std::int32_t>::max());
  Counter counter(&in);
  counter.Add(type, 0);
  return counter.bytes();
}

}  // namespace selfcal
