// Runs the experiments of the evaluation; called by test/evaluate.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "test/evaluation/context.h"
#include "test/evaluation/experiments.h"
#include "test/evaluation/summary.h"

namespace selfcal {
namespace {

int List() {
  for (const Experiment& experiment : Experiments()) {
    fmt::print("{:<16} {}\n", experiment.name, experiment.about);
  }
  return 0;
}

// The experiments of these names, all without any; false for a wrong name.
bool Select(const std::vector<std::string>& names,
            std::vector<Experiment>* selected) {
  for (const std::string& name : names) {
    if (std::none_of(Experiments().begin(),
                     Experiments().end(),
                     [&](const Experiment& e) { return e.name == name; })) {
      fmt::print(stderr, "no experiment '{}'; --list names them\n", name);
      return false;
    }
  }
  for (const Experiment& experiment : Experiments()) {
    if (names.empty() ||
        std::find(names.begin(), names.end(), experiment.name) != names.end()) {
      selected->push_back(experiment);
    }
  }
  return true;
}

std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

// Experiment after experiment; the summary is written after each, so that what
// has run is not lost.
int Run(const std::filesystem::path& out,
        const std::vector<Experiment>& experiments,
        bool quick,
        int threads) {
  std::filesystem::create_directories(out);
  const std::filesystem::path summary = out / "summary.json";
  int failed = 0;
  int missed = 0;
  for (const Experiment& experiment : experiments) {
    try {
      Context context(out, experiment.name, quick, threads);
      context.Progress("begins: " + experiment.about);
      experiment.run(&context);
      context.Progress("done");
      const std::string text = MergeSummary(
          ReadFile(summary), {experiment.name}, context.figures(), quick);
      std::ofstream file(summary);
      file << text;
      file.close();
      if (!file) throw std::runtime_error("cannot write " + summary.string());
      for (const Figure& figure : context.figures()) {
        missed += !figure.Holds();
      }
    } catch (const std::exception& error) {
      ++failed;
      fmt::print(
          stderr, "{}: could not run: {}\n", experiment.name, error.what());
    }
  }
  fmt::print(
      stderr,
      "{} experiments, {} could not run, {} figures miss their bound{}\n",
      experiments.size(),
      failed,
      missed,
      quick ? " (quick form: thin statistics)" : "");
  return failed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  CLI::App app("The evaluation of selfcal");
  std::string out;
  std::vector<std::string> only;
  bool quick = false;
  bool list = false;
  int threads =
      static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  app.add_option("--out", out, "Folder for the results");
  app.add_option("--only", only, "Experiments, separated by commas")
      ->delimiter(',');
  app.add_flag("--quick", quick, "Seconds instead of minutes for each");
  app.add_option("--threads", threads, "Of an experiment; as many as cores")
      ->check(CLI::PositiveNumber);
  app.add_flag("--list", list, "Names of the experiments");
  CLI11_PARSE(app, argc, argv);
  if (list) return selfcal::List();
  std::vector<selfcal::Experiment> experiments;
  if (!selfcal::Select(only, &experiments)) return 1;
  if (out.empty()) {
    fmt::print(stderr, "--out DIR is missing\n");
    return 1;
  }
  return selfcal::Run(out, experiments, quick, threads);
}
