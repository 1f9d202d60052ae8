// The log on stderr: text, or one JSON object on each line.
#pragma once

#include <string>

namespace selfcal::server {

// Once, before anything is logged. `format` is "text" or "json".
void SetUpLog(const std::string& level, const std::string& format);

// Any thread, at any time.
void SetLogLevel(const std::string& level);

}  // namespace selfcal::server
