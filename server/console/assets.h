// The files of the pages, which are built from server/console/web and embedded
// into the program.
#pragma once

#include <span>
#include <string_view>

namespace selfcal::server {

struct Asset {
  std::string_view path;  // starts with "/"
  std::string_view type;
  std::string_view bytes;
};

// The first asset is the HTML page, which is served at the address of every
// page.
std::span<const Asset> Assets();

}  // namespace selfcal::server
