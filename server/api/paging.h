// Pages of lists: limits on requests, and the filling of responses.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <algorithm>
#include <cstddef>
#include <string>

#include "server/api/errors.h"
#include "server/store/store.h"

namespace selfcal::server {

inline constexpr int kDefaultPageSize = 50;
inline constexpr int kMaxPageSize = 1000;
// Pages are truncated to this size, because a client receives at most 4 MiB by
// default. A client that reads page by page does not notice it.
inline constexpr std::size_t kMaxPageBytes = 3u << 20;

// Returns a page of at most `max_size` items. `fetch` takes a Page and returns
// a StatusOr<Listed<T>>; `add` takes a T and the response, and returns an
// absl::Status.
template <typename Response, typename Request, typename Fetch, typename Add>
absl::StatusOr<Response> FillPage(const Request& request,
                                  const std::string& parent,
                                  const Fetch& fetch,
                                  const Add& add,
                                  int max_size = kMaxPageSize) {
  if (request.page_size() < 0) {
    return InvalidFields(
        {{"page_size", "is negative; send 0 for the default of 50"}});
  }
  Page page;
  page.token = request.page_token();
  page.size = std::min(
      request.page_size() == 0 ? kDefaultPageSize : int{request.page_size()},
      max_size);
  for (;;) {
    const auto listed = fetch(page);
    if (!listed.ok()) {
      return About(listed.status(), {kRigType, parent, "page_token"});
    }
    Response response;
    for (const auto& item : listed->items) {
      if (absl::Status added = add(item, &response); !added.ok()) return added;
    }
    response.set_next_page_token(listed->next_token);
    const std::size_t bytes = response.ByteSizeLong();
    if (page.size == 1 || bytes <= kMaxPageBytes) return response;
    // As many as probably fit; a tenth less than their mean size says.
    const double fits = 0.9 * kMaxPageBytes / bytes * listed->items.size();
    page.size = std::clamp(static_cast<int>(fits), 1, page.size - 1);
  }
}

}  // namespace selfcal::server
