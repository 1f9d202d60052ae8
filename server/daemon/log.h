// The log on stderr: text, or one JSON object per line.
#pragma once

#include <string>

namespace selfcal::server {

// Sets up the log. Call it once, before anything is logged. `format` is "text"
// or "json".
void SetUpLog(const std::string& level, const std::string& format);

// Any thread may call at any time.
void SetLogLevel(const std::string& level);

}  // namespace selfcal::server
