#include "proto/safe_text.h"

#include <algorithm>

namespace selfcal {
namespace {

// Returns the number of bytes of the UTF-8 character at the start of the text;
// 0 if there is none.
std::size_t CharacterSize(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned char>(text[i]);
  };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
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

// The code point of a valid character.
char32_t CodePoint(std::string_view character) {
  const auto first = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return first;
  char32_t code = first & (0x7f >> character.size());
  for (const char c : character.substr(1)) {
    code = code << 6 | (static_cast<unsigned char>(c) & 0x3f);
  }
  return code;
}

// Of Unicode: the controls C0 and C1, separators of lines and paragraphs, and
// marks, overrides and isolates of the direction.
bool IsControl(char32_t code) {
  return code < 0x20 || (code >= 0x7f && code < 0xa0) || code == 0x61c ||
         code == 0x200e || code == 0x200f ||
         (code >= 0x2028 && code <= 0x202e) ||
         (code >= 0x2066 && code <= 0x2069);
}

std::string Safe(std::string_view text,
                 std::size_t max_bytes,
                 std::string_view allowed) {
  constexpr std::string_view kEllipsis = "...";
  std::string result;
  // The length of the result if the rest does not fit.
  std::size_t cut = 0;
  for (std::size_t i = 0; i < text.size() && result.size() <= max_bytes;) {
    const std::size_t size = CharacterSize(text.substr(i));
    const std::string_view character = text.substr(i, size);
    const bool is_safe =
        size > 0 && (!IsControl(CodePoint(character)) ||
                     allowed.find(character) != std::string_view::npos);
    if (is_safe) {
      result += character;
    } else {
      result += '?';
    }
    i += std::max<std::size_t>(size, 1);
    if (result.size() + kEllipsis.size() <= max_bytes) cut = result.size();
  }
  if (result.size() <= max_bytes) return result;
  return result.substr(0, cut) + std::string(kEllipsis);
}

}  // namespace

std::string SafeLine(std::string_view text, std::size_t max_bytes) {
  return Safe(text, max_bytes, "");
}

std::string SafeLines(std::string_view text) {
  return Safe(text, std::string_view::npos, "\n\t");
}

}  // namespace selfcal
