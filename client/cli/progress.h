// A progress bar on stderr; shown only if stderr is a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::client {

// Returns "label [#####-----] 12/40 note", for a line of `width` characters.
std::string ProgressLine(std::string_view label,
                         std::size_t done,
                         std::size_t total,
                         std::string_view note,
                         std::size_t width);

// Not thread-safe.
class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();  // removes the bar
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Show(std::size_t done, std::size_t total, std::string_view note);
  void Say(std::string_view note);  // shows a note if the total is unknown
  void Clear();  // removes the bar before other output to the terminal

 private:
  void Put(const std::string& line);

  const std::string label_;
  const bool terminal_;
  bool shown_ = false;
};

}  // namespace selfcal::client
