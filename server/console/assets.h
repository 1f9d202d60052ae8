// The files of the pages, built from server/console/web into the program.
#pragma once

#include <span>
#include <string_view>

namespace selfcal::server {

struct Asset {
  std::string_view path;  // from "/" on
  std::string_view type;
  std::string_view bytes;
};

// The first is the page that all addresses of pages show.
std::span<const Asset> Assets();

}  // namespace selfcal::server
