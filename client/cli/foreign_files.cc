#include "client/cli/foreign_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>

#include "client/cli/choice.h"
#include "client/cli/new_file.h"
#include "client/import/read_file.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

}  // namespace

CLI::Validator FormatNames() {
  std::vector<std::string> names;
  for (const FormatInfo& format : Formats()) names.push_back(format.name);
  return OneOf(names);
}

absl::StatusOr<std::vector<TextFile>> ReadTextFiles(
    const std::vector<std::string>& paths) {
  std::vector<TextFile> files;
  for (const std::string& path : paths) {
    auto text = ReadFile(path);
    if (!text.ok()) return text.status();
    files.push_back({path, *std::move(text)});
  }
  return files;
}

void PrintLosses(const std::vector<Loss>& losses) {
  for (const Loss& loss : losses) {
    const std::string line =
        fmt::format("{}: {}: {}\n",
                    loss.changes_prediction ? "lost" : "note",
                    loss.name,
                    loss.text);
    std::fputs(line.c_str(), stderr);
  }
}

bool ChangesPrediction(const std::vector<Loss>& losses) {
  return std::any_of(losses.begin(), losses.end(), [](const Loss& loss) {
    return loss.changes_prediction;
  });
}

std::vector<std::string> OutputPaths(const std::vector<TextFile>& files,
                                     const std::string& output) {
  std::error_code error;
  const bool folder = files.size() > 1 || output.empty() ||
                      output.back() == '/' || fs::is_directory(output, error);
  if (!folder) return {output};
  std::vector<std::string> paths;
  for (const TextFile& file : files) {
    paths.push_back((fs::path(output) / file.name).string());
  }
  return paths;
}

absl::Status WriteTextFiles(const std::vector<TextFile>& files,
                            const std::vector<std::string>& paths,
                            bool overwrite) {
  std::deque<NewFile> unfinished(files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    const fs::path folder = fs::path(paths[i]).parent_path();
    std::error_code error;
    if (!folder.empty()) fs::create_directories(folder, error);
    if (error) {
      return absl::FailedPreconditionError(fmt::format(
          "cannot create the folder {}: {}", folder.string(), error.message()));
    }
    absl::Status status = unfinished[i].Open(paths[i], overwrite);
    if (status.ok()) status = unfinished[i].Append(files[i].text);
    if (!status.ok()) return status;
  }
  for (NewFile& file : unfinished) {
    if (absl::Status status = file.Commit(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace selfcal::client
