// Opaque page tokens: where the last page ended, bound to its list.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/store/store.h"

namespace selfcal::server {

// Number of items of the page: 50 if none is given, at most 1000.
int PageSize(const Page& page);

// The token of the page after the item with `key`, in the list named `list`.
std::string MakePageToken(std::string_view list, std::string_view key);
std::string MakePageToken(std::string_view list, std::int64_t key);

// The key in the token of a page; nullopt for the first page. INVALID_ARGUMENT
// for a token of another list.
absl::StatusOr<std::optional<std::string>> PageKey(std::string_view list,
                                                   const Page& page);
absl::StatusOr<std::optional<std::int64_t>> PageNumber(std::string_view list,
                                                       const Page& page);

absl::Status BadPageToken();

// For a list that was read one item beyond the page: drops that item and makes
// the token, if the item was there. `key` returns the key of an item.
template <typename T, typename Key>
void CutPage(std::string_view list, int size, Key key, Listed<T>* listed) {
  if (static_cast<int>(listed->items.size()) > size) {
    listed->items.resize(size);
    listed->next_token = MakePageToken(list, key(listed->items.back()));
  }
}

}  // namespace selfcal::server
