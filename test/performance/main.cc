// Measures both hot paths, scoring and recalibration, against general solvers
// and against themselves. Times on one thread but where a case says otherwise;
// run by test/benchmark, which keeps the linear algebra libraries to one.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <regex>
#include <string>
#include <vector>

#include "core/simd/vector_width.h"
#include "test/performance/cases.h"
#include "test/performance/report.h"
#include "test/performance/scene.h"

namespace selfcal {
namespace {

std::vector<Case> SelectCases(const std::string& pattern) {
  const std::regex wanted(pattern);
  std::vector<Case> selected;
  for (const auto& make : {ScoreCases, CalibrationCases, ScalingCases}) {
    for (Case& one : make()) {
      if (std::regex_search(one.name, wanted)) {
        selected.push_back(std::move(one));
      }
    }
  }
  return selected;
}

int Run(const std::string& json,
        const std::string& pattern,
        const TimingOptions& options) {
  fmt::print("segment: {}\nvectors: {}\n{}\n",
             Describe(MakeScene()),
             VectorWidthName(WidestVectors()),
             TableHead());
  std::vector<Result> results;
  for (const Case& one : SelectCases(pattern)) {
    results.push_back({one, one.measure(options)});
    fmt::print("{}\n", TableLine(results.back()));
    std::fflush(stdout);
  }
  if (json.empty()) return 0;
  std::ofstream file(json);
  WriteJson(results, file);
  file.close();
  if (file) return 0;
  std::cerr << "cannot write " << json << "\n";
  return 1;
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  CLI::App app("The benchmark of selfcal");
  std::string json;
  std::string only;
  bool quick = false;
  app.add_option("--json", json, "Write the ratios to this file");
  app.add_option("--only", only, "Cases that match this regular expression");
  app.add_flag("--quick", quick, "Few and short repetitions");
  CLI11_PARSE(app, argc, argv);
  selfcal::TimingOptions options;
  if (quick) options = {.repetitions = 3, .min_time_s = 0.02};
  try {
    return selfcal::Run(json, only, options);
  } catch (const std::regex_error& error) {
    std::cerr << "--only: " << error.what() << "\n";
    return 1;
  }
}
