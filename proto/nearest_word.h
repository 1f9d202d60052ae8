// Suggestions for words that are not known.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal {

// Returns the known word of which `word` is most likely a misspelling or the
// beginning; empty if none is near. Upper and lower case are the same.
std::string NearestWord(std::string_view word,
                        const std::vector<std::string>& known);

// Returns "; did you mean 'list'?", or an empty text if no known word is near.
std::string DidYouMean(std::string_view word,
                       const std::vector<std::string>& known);

}  // namespace selfcal
