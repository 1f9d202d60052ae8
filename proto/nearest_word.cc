#include "proto/nearest_word.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace selfcal {
namespace {

constexpr std::size_t kLongest = 100;  // of a word that is compared
constexpr std::size_t kShortestPrefix = 3;

std::string LowerCase(std::string_view word) {
  std::string lower(word);
  for (char& c : lower) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return lower;
}

// Number of letters to insert, remove or replace, or neighbours to swap.
std::size_t Distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> steps(
      a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        steps[i][j] = i + j;
        continue;
      }
      const std::size_t replaced =
          steps[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      steps[i][j] =
          std::min({steps[i - 1][j] + 1, steps[i][j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        steps[i][j] = std::min(steps[i][j], steps[i - 2][j - 2] + 1);
      }
    }
  }
  return steps[a.size()][b.size()];
}

}  // namespace

std::string NearestWord(std::string_view word,
                        const std::vector<std::string>& known) {
  if (word.empty() || word.size() > kLongest) return "";
  const std::string lower = LowerCase(word);
  // A third of the letters may be wrong, but at least one.
  std::size_t nearest = std::max<std::size_t>(1, word.size() / 3) + 1;
  std::string found;
  for (const std::string& one : known) {
    if (one.size() > kLongest) continue;
    const std::size_t distance = Distance(lower, LowerCase(one));
    if (distance >= nearest || distance >= one.size()) continue;
    nearest = distance;
    found = one;
  }
  if (!found.empty() || word.size() < kShortestPrefix) return found;
  const auto longer = std::find_if(
      known.begin(), known.end(), [&lower](const std::string& one) {
        return LowerCase(one).starts_with(lower);
      });
  return longer == known.end() ? "" : *longer;
}

std::string DidYouMean(std::string_view word,
                       const std::vector<std::string>& known) {
  const std::string nearest = NearestWord(word, known);
  return nearest.empty() ? "" : "; did you mean '" + nearest + "'?";
}

}  // namespace selfcal
