// restore: replaces the daemon's database by a backup.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/confirmation.h"
#include "client/cli/progress.h"
#include "client/cli/sha256.h"
#include "client/text/text.h"
#include "selfcal/v1/store_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using Clock = std::chrono::system_clock;
using StoreService = v1::StoreService::StubInterface;

constexpr std::size_t kPiece = 1 << 20;
constexpr std::chrono::milliseconds kRetryEvery{200};
constexpr double kDefaultTimeoutS = 120;

struct RestoreOptions {
  std::string path;
  bool yes = false;
  double timeout_s = kDefaultTimeoutS;
};

// True if the file starts like an SQLite database of the daemon; other files
// need not be sent. The daemon then checks the whole file.
bool IsBackup(std::istream* file) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  constexpr std::string_view kApplication = "SCAL";
  constexpr std::size_t kApplicationAt = 68;
  std::string header(kApplicationAt + kApplication.size(), '\0');
  file->read(header.data(), static_cast<std::streamsize>(header.size()));
  return *file && header.starts_with(kMagic) && header.ends_with(kApplication);
}

absl::Status OpenBackup(const std::string& path, std::ifstream* file) {
  file->open(path, std::ios::binary);
  std::error_code error;
  if (!*file || !std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(fmt::format("cannot read {}", path));
  }
  if (!IsBackup(file)) {
    return absl::InvalidArgumentError(
        fmt::format("{} is not a backup of selfcald: name a file written by "
                    "`selfcal daemon backup`",
                    path));
  }
  file->seekg(0);
  return absl::OkStatus();
}

std::string Question(const Context& context, const std::string& path) {
  return fmt::format(
      "Replace the database of the daemon at {1} by {0}?\n"
      "What was stored since the backup is only in the present database, which "
      "is kept under another name.",
      path,
      context.target.address);
}

// Sends the file. Returns false if it could not be read to its end.
bool SendFile(std::ifstream* file,
              std::size_t size,
              grpc::ClientWriterInterface<v1::RestoreStoreRequest>* writer) {
  Progress progress("restore");
  Sha256 digest;
  std::vector<char> piece(kPiece);
  v1::RestoreStoreRequest request;
  std::size_t sent = 0;
  while (file->read(piece.data(), kPiece), file->gcount() > 0) {
    request.set_data(piece.data(), static_cast<std::size_t>(file->gcount()));
    digest.Add(request.data());
    // The status of the call has the error.
    if (!writer->Write(request)) return true;
    sent += request.data().size();
    progress.Show(sent / kPiece, size / kPiece, "MiB");
  }
  if (!file->eof()) return false;
  request.set_sha256(digest.Finish());
  writer->Write(request);
  writer->WritesDone();
  return true;
}

// True if a daemon answers on a new connection.
bool Answers(Context* context) {
  if (!context->Connect().ok()) return false;
  const auto stub = v1::StoreService::NewStub(context->Channel());
  v1::ListEventsRequest request;
  request.set_page_size(1);
  v1::ListEventsResponse response;
  return !IsUnreachable(Call<StoreService>(
      stub.get(), &StoreService::ListEvents, request, &response));
}

// Waits until the present connection breaks, because the daemon stops, and the
// daemon answers on a new connection.
bool WaitForNewStart(Context* context, double timeout_s) {
  Progress progress("restore");
  progress.Say("verified; the daemon restarts");
  const auto until =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(
                         std::chrono::duration<double>(timeout_s));
  const auto before = context->Channel();
  while (before->GetState(false) == GRPC_CHANNEL_READY) {
    if (!before->WaitForStateChange(GRPC_CHANNEL_READY, until)) return false;
  }
  do {
    if (Answers(context)) return true;
    std::this_thread::sleep_for(kRetryEvery);
  } while (Clock::now() < until);
  return false;
}

int ReportRestored(Context* context,
                   const RestoreOptions& options,
                   const v1::RestoreStoreResponse& response) {
  if (context->json) {
    context->PrintJson(response);
  } else {
    Facts facts;
    facts.Add("restored", options.path);
    facts.Add("previous database", response.previous_database());
    context->Print(facts);
  }
  if (WaitForNewStart(context, options.timeout_s)) return kDone;
  PrintError(fmt::format(
      "the daemon at {} did not restart within {:g} s: see its log. The backup "
      "is verified, and is put in place when the daemon next starts",
      context->target.address,
      options.timeout_s));
  return kUnreachable;
}

int Restore(Context* context, const RestoreOptions& options) {
  std::ifstream file;
  const absl::Status opened = OpenBackup(options.path, &file);
  if (!opened.ok()) return FailInput(opened);
  if (!options.yes && !Confirmed(Question(*context, options.path))) {
    PrintError("nothing was changed; use --yes to restore without a prompt");
    return kUsage;
  }
  const auto stub = v1::StoreService::NewStub(context->Channel());
  grpc::ClientContext call;
  v1::RestoreStoreResponse response;
  const auto writer = stub->RestoreStore(&call, &response);
  std::error_code error;
  const auto size = std::filesystem::file_size(options.path, error);
  const bool read = SendFile(&file, error ? 0 : size, writer.get());
  if (!read) call.TryCancel();
  const grpc::Status status = writer->Finish();
  if (!read) {
    return FailInput(absl::DataLossError(
        fmt::format("cannot read {} to its end", options.path)));
  }
  if (!status.ok()) return Fail(*context, status);
  return ReportRestored(context, options, response);
}

}  // namespace

CLI::App* AddRestore(CLI::App* parent,
                     const std::string& name,
                     Context* context) {
  CLI::App* restore = parent->add_subcommand(
      name,
      "Replace the daemon's database by a backup: the daemon verifies the "
      "backup, keeps the present database under another name and restarts");
  const auto options = std::make_shared<RestoreOptions>();
  restore
      ->add_option(
          "FILE", options->path, "A file written by `selfcal daemon backup`")
      ->required();
  restore->add_flag("--yes", options->yes, "Do not ask for confirmation");
  restore
      ->add_option("--timeout",
                   options->timeout_s,
                   "Give up after waiting this long for the restart [s]")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  restore->callback([context, options] {
    context->command = [context, options] {
      return Restore(context, *options);
    };
  });
  return restore;
}

}  // namespace selfcal::client
