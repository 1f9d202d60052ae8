// The terminal that a command writes to.
#pragma once

namespace selfcal::client {

// Present size of the terminal on stdout; 80 x 24 if it is unknown.
struct TerminalSize {
  int columns = 80;
  int rows = 24;
};
TerminalSize CurrentTerminalSize();

// When the output has colours.
enum class ColorMode { kAuto, kAlways, kNever };

// True if the output has colours. kAuto stands for a terminal, unless the
// environment variable NO_COLOR is set or TERM is "dumb".
bool UsesColor(ColorMode mode, bool terminal);

}  // namespace selfcal::client
