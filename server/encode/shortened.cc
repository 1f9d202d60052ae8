#include "server/encode/shortened.h"

#include <algorithm>

namespace selfcal::server {
namespace {

// Returns the number of bytes of the UTF-8 character at the start of the text;
// 0 if there is none or it is a control character.
std::size_t CharacterSize(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned char>(text[i]);
  };
  const unsigned char first = byte(0);
  if (first < 0x80) return first >= 0x20 && first != 0x7f ? 1 : 0;
  const std::size_t size = first >= 0xc2 && first <= 0xdf   ? 2
                           : first >= 0xe0 && first <= 0xef ? 3
                           : first >= 0xf0 && first <= 0xf4 ? 4
                                                            : 0;
  if (size == 0 || text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // Overlong encodings, surrogates, and values beyond the last code point.
  if (first == 0xe0 && byte(1) < 0xa0) return 0;
  if (first == 0xed && byte(1) > 0x9f) return 0;
  if (first == 0xf0 && byte(1) < 0x90) return 0;
  if (first == 0xf4 && byte(1) > 0x8f) return 0;
  return size;
}

}  // namespace

std::string Shortened(std::string_view text, std::size_t max_bytes) {
  constexpr std::string_view kEllipsis = "...";
  std::string result;
  std::size_t i = 0;
  // The length of the result if the rest does not fit.
  std::size_t cut = 0;
  while (i < text.size() && result.size() <= max_bytes) {
    const std::size_t size = CharacterSize(text.substr(i));
    if (size == 0) {
      result += '?';
    } else {
      result += text.substr(i, size);
    }
    i += std::max<std::size_t>(size, 1);
    if (result.size() + kEllipsis.size() <= max_bytes) cut = result.size();
  }
  if (result.size() <= max_bytes) return result;
  return result.substr(0, cut) + std::string(kEllipsis);
}

}  // namespace selfcal::server
