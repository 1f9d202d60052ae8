// Reads the fields of a serialised ROS message one by one.
//
// ROS 1 packs its fields, little-endian. ROS 2 uses CDR (OMG DDS-RTPS 2.5,
// section 10): four bytes state the byte order, fields are aligned to their
// size from there on, and a string ends with a NUL.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <vector>

namespace selfcal::client {

enum class Wire { kRos1, kCdr };

// A field that is not there is 0 or empty, as are all after it, and ok() is
// false from then on. Views are into the bytes.
class WireReader {
 public:
  WireReader(Wire wire, std::string_view bytes) : wire_(wire), bytes_(bytes) {
    if (wire != Wire::kCdr) return;
    // Plain CDR, big-endian or little-endian; other encodings have other rules.
    ok_ = bytes.size() >= 4 && bytes[0] == 0 && (bytes[1] & ~1) == 0;
    if (!ok_) return;
    big_endian_ = bytes[1] == 0;
    bytes_.remove_prefix(4);
  }

  bool ok() const { return ok_; }

  template <typename T>
  T Read() {
    static_assert(std::is_arithmetic_v<T>);
    Align(sizeof(T));
    T value{};
    const std::string_view raw = Take(sizeof(T));
    if (!ok_) return value;
    char swapped[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      swapped[i] = raw[big_endian_ ? sizeof(T) - 1 - i : i];
    }
    std::memcpy(&value, swapped, sizeof(T));
    return value;
  }

  std::string_view ReadString() {
    const std::size_t size = Read<std::uint32_t>();
    if (wire_ == Wire::kRos1) return Take(size);
    std::string_view text = Take(size);
    // The NUL is counted; some writers leave it out of an empty string.
    if (!text.empty() && text.back() == '\0') text.remove_suffix(1);
    return text;
  }

  // A sequence of bytes.
  std::string_view ReadBytes() { return Take(Read<std::uint32_t>()); }

  // `count` numbers without a length before them.
  std::vector<double> ReadDoubles(std::size_t count) {
    std::vector<double> numbers;
    if (count > bytes_.size() / sizeof(double)) ok_ = false;
    for (std::size_t i = 0; i < count && ok_; ++i) {
      numbers.push_back(Read<double>());
    }
    return numbers;
  }

 private:
  void Align(std::size_t size) {
    if (wire_ == Wire::kCdr) Take((size - at_ % size) % size);
  }

  std::string_view Take(std::size_t size) {
    if (!ok_ || size > bytes_.size() - at_) {
      ok_ = false;
      return {};
    }
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }

  const Wire wire_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool big_endian_ = false;
  bool ok_ = true;
};

}  // namespace selfcal::client
