// The series of a daemon against the table of docs/operations.md: names, types,
// labels, and the values of a label where the table lists them.
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "test/server/daemon/daemon_fixture.h"
#include "test/server/http_get.h"
#include "test/support/certificates.h"
#include "test/support/eventually.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

struct SeriesFamily {
  std::string type;
  std::map<std::string, std::set<std::string>> labels;  // with their values
};
using SeriesFamilies = std::map<std::string, SeriesFamily>;

std::vector<std::string> SplitAt(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) {
    parts.push_back(part);
  }
  return parts;
}

// The words between backticks.
std::vector<std::string> CodeIn(const std::string& text) {
  static const std::regex kCode("`([^`]+)`");
  std::vector<std::string> words;
  for (std::sregex_iterator at(text.begin(), text.end(), kCode), end; at != end;
       ++at) {
    words.push_back((*at)[1]);
  }
  return words;
}

// "`verdict`: `stored`, `failed`" or "`rig`, `group`", several after
// semicolons.
std::map<std::string, std::set<std::string>> DocumentedLabels(
    const std::string& cell) {
  std::map<std::string, std::set<std::string>> labels;
  for (const std::string& part : SplitAt(cell, ';')) {
    const std::vector<std::string> words = CodeIn(part);
    if (part.find("`: `") == part.npos) {
      for (const std::string& label : words) labels[label];
    } else {
      labels[words.front()] = {words.begin() + 1, words.end()};
    }
  }
  return labels;
}

std::string DocumentedType(const std::string& name,
                           const std::string& meaning) {
  if (meaning.find("histogram") != meaning.npos) return "histogram";
  return name.ends_with("_total") ? "counter" : "gauge";
}

SeriesFamilies Documented(const std::string& document) {
  const std::size_t begin = document.find("| series | labels | meaning |");
  if (begin == document.npos) return {};
  SeriesFamilies families;
  const std::size_t size = document.find("\n\n", begin) - begin;
  for (const std::string& row : SplitAt(document.substr(begin, size), '\n')) {
    const std::vector<std::string> cells = SplitAt(row, '|');
    if (cells.size() != 4) {
      ADD_FAILURE() << "not a row of three cells: " << row;
      continue;
    }
    for (const std::string& name : CodeIn(cells[1])) {
      const bool is_new = families
                              .insert({name,
                                       {DocumentedType(name, cells[3]),
                                        DocumentedLabels(cells[2])}})
                              .second;
      EXPECT_TRUE(is_new) << name << " is in two rows";
    }
  }
  return families;
}

SeriesFamilies Exposed(const std::string& series) {
  static const std::regex kType("# TYPE ([^ ]+) ([a-z]+)");
  static const std::regex kLabel("([a-z]+)=\"([^\"]*)\"");
  SeriesFamilies families;
  SeriesFamily* family = nullptr;  // of the line
  for (const std::string& line : SplitAt(series, '\n')) {
    std::smatch match;
    if (std::regex_match(line, match, kType)) {
      family = &families[match[1]];
      family->type = match[2];
    } else if (family != nullptr && !line.starts_with('#')) {
      for (std::sregex_iterator at(line.begin(), line.end(), kLabel), end;
           at != end;
           ++at) {
        const std::string label = (*at)[1];
        const bool bucket = family->type == "histogram" && label == "le";
        if (!bucket) family->labels[label].insert((*at)[2]);
      }
    }
  }
  return families;
}

std::set<std::string> NamesOf(const SeriesFamilies& families) {
  std::set<std::string> names;
  for (const auto& [name, family] : families) names.insert(name);
  return names;
}

// The labels, with the values of those whose values the table lists.
std::map<std::string, std::set<std::string>> ComparedLabels(
    const SeriesFamily& exposed, const SeriesFamily& documented) {
  std::map<std::string, std::set<std::string>> labels = exposed.labels;
  for (auto& [label, values] : labels) {
    const auto listed = documented.labels.find(label);
    if (listed != documented.labels.end() && listed->second.empty()) {
      values.clear();
    }
  }
  return labels;
}

class MetricsDocumentTest : public DaemonTest {
 protected:
  // The series of a daemon that has all of them: with TLS and a hub, after a
  // segment was scored.
  std::string AllSeries() {
    const Certificates certificates;
    const auto daemon = StartWithTls(
        certificates,
        {"--metrics", "127.0.0.1:0", "--uplink", "unix:/nonexistent/hub.sock"});
    Stream(TestSegments(CreateRig(), 1));
    const std::string url = daemon->Word("metrics: ");
    std::string series;
    EXPECT_TRUE(Eventually(
        [&] {
          series = HttpGet(url);
          return series.find("selfcal_uplink_waiting_records{") !=
                     series.npos &&
                 series.find("selfcal_segment_entropy_nats_count{") !=
                     series.npos;
        },
        kLongWait,
        kDaemonInterval));
    return series;
  }
};

TEST_F(MetricsDocumentTest, TableShowsEverySeriesWithItsTypeAndLabels) {
  const SeriesFamilies exposed = Exposed(AllSeries());
  const SeriesFamilies documented = Documented(ReadBytes(SELFCAL_OPERATIONS));
  EXPECT_GT(exposed.size(), 20u);
  EXPECT_EQ(NamesOf(documented), NamesOf(exposed));
  for (const auto& [name, family] : exposed) {
    const auto row = documented.find(name);
    if (row == documented.end()) continue;
    EXPECT_EQ(row->second.type, family.type) << name;
    EXPECT_EQ(row->second.labels, ComparedLabels(family, row->second)) << name;
  }
}

}  // namespace
}  // namespace selfcal::server
