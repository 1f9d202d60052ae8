// What an experiment is given to report with: files go to <out>/<experiment>/.
//
// An experiment that cannot run throws (any std::exception); a figure that
// misses its bound is a result, not a failure.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "test/evaluation/plot.h"
#include "test/evaluation/summary.h"
#include "test/evaluation/table.h"

namespace selfcal {

struct CheckOptions {
  std::string unit = "";
  // The figure must hold in the quick form too.
  bool robust = false;
};

class Context {
 public:
  // Makes the folder of the experiment, empty; threads: those of ForEach.
  Context(const std::filesystem::path& out,
          const std::string& experiment,
          bool quick,
          int threads);

  // A few seconds instead of minutes: fewer datasets, shorter ones.
  bool quick() const { return quick_; }

  // A line on stderr, with the time since the experiment began.
  void Progress(const std::string& what) const;

  // Calls work(0) .. work(count - 1), on the threads of the context; each i may
  // only write what is its own. Not for what is timed. An exception of a call
  // is thrown again, once the others have ended.
  void ForEach(int count, const std::function<void(int)>& work) const;

  // <name>.csv and <name>.md.
  void WriteTable(const std::string& name, const ResultTable& table) const;
  // <name>.plot.json, from which plot.py makes <name>.svg.
  void WritePlot(const std::string& name, const Plot& plot) const;

  // One figure against its bound, for summary.json; throws if it is not finite.
  // Names are unique over all experiments: "<experiment>.<what>".
  void AtMost(const std::string& name,
              double value,
              double bound,
              const CheckOptions& options = {});
  void AtLeast(const std::string& name,
               double value,
               double bound,
               const CheckOptions& options = {});
  void Within(const std::string& name,
              double value,
              double low,
              double high,
              const CheckOptions& options = {});

  const std::vector<Figure>& figures() const { return figures_; }

 private:
  void Check(Figure figure, const CheckOptions& options);
  void Write(const std::string& file, const std::string& text) const;

  const std::string experiment_;
  const std::filesystem::path folder_;
  const bool quick_;
  const int threads_;
  const std::chrono::steady_clock::time_point begin_;
  std::vector<Figure> figures_;
};

}  // namespace selfcal
