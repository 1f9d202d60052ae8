// A bar on stderr for what takes time; nothing at all unless stderr is a
// terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::client {

// "label [#####-----] 12/40 note", for a line of `width` characters.
std::string ProgressLine(std::string_view label,
                         std::size_t done,
                         std::size_t total,
                         std::string_view note,
                         std::size_t width);

// Not thread-safe.
class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();  // takes the bar away
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Show(std::size_t done, std::size_t total, std::string_view note);
  void Say(std::string_view note);  // where the total is not known
  void Clear();                     // before other output to the terminal

 private:
  void Put(const std::string& line);

  const std::string label_;
  const bool terminal_;
  bool shown_ = false;
};

}  // namespace selfcal::client
