// Pages of the lists that canned daemons answer with.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

namespace selfcal::client {

// Calls `add` for each item of the page; pages have two items, whatever was
// asked for.
template <typename Request, typename Items, typename Response, typename Add>
void FillCannedPage(const Request& request,
                    const Items& items,
                    Response* response,
                    const Add& add) {
  const std::size_t begin =
      request.page_token().empty() ? 0 : std::stoul(request.page_token());
  const std::size_t end = std::min(begin + 2, items.size());
  for (std::size_t i = begin; i < end; ++i) add(items[i]);
  if (end < items.size()) {
    response->set_next_page_token(std::to_string(end));
  }
}

}  // namespace selfcal::client
