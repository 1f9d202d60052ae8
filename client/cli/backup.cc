// backup: copies the daemon's database to a file, atomically.
#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/new_file.h"
#include "client/cli/progress.h"
#include "client/cli/sha256.h"
#include "client/text/text.h"
#include "selfcal/v1/store_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using Summary = v1::BackupStoreResponse::Summary;

// Receives all pieces. *arrived summarises what was received, so that it can be
// compared with the daemon's summary of what it sent.
grpc::Status Receive(v1::StoreService::StubInterface* stub,
                     NewFile* file,
                     absl::Status* written,
                     Summary* sent,
                     Summary* arrived) {
  Progress progress("backup");
  progress.Say("the daemon copies its database");
  grpc::ClientContext call;
  const auto reader = stub->BackupStore(&call, v1::BackupStoreRequest());
  Sha256 digest;
  v1::BackupStoreResponse response;
  while (written->ok() && reader->Read(&response)) {
    if (response.has_summary()) *sent = response.summary();
    digest.Add(response.data());
    *written = file->Append(response.data());
    arrived->set_bytes(arrived->bytes() +
                       static_cast<std::int64_t>(response.data().size()));
    progress.Say(BytesText(arrived->bytes()));
  }
  if (!written->ok()) call.TryCancel();
  arrived->set_sha256(digest.Finish());
  return reader->Finish();
}

int Backup(Context* context, const std::string& path, bool force) {
  NewFile file;
  absl::Status written = file.Open(path, force);
  if (!written.ok()) return FailInput(written);
  const auto stub = v1::StoreService::NewStub(context->Channel());
  Summary sent;
  Summary arrived;
  const grpc::Status status =
      Receive(stub.get(), &file, &written, &sent, &arrived);
  if (written.ok()) {
    if (!status.ok()) return Fail(*context, status);
    if (arrived.bytes() != sent.bytes() || arrived.sha256() != sent.sha256()) {
      PrintError(fmt::format(
          "the backup is incomplete: try again; {} was not written", path));
      return kFailed;
    }
    written = file.Commit();
  }
  if (!written.ok()) return FailInput(written);
  const std::string sha256 = HexText(arrived.sha256());
  if (context->json) {
    // The form of sha256sum, instead of base64.
    google::protobuf::Struct document;
    auto& fields = *document.mutable_fields();
    fields["bytes"].set_string_value(fmt::format("{}", arrived.bytes()));
    fields["sha256"].set_string_value(sha256);
    context->PrintJson(document);
    return kDone;
  }
  Facts facts;
  facts.Add("backup", path);
  facts.Add("size", BytesText(arrived.bytes()));
  facts.Add("sha256", sha256);
  context->Print(facts);
  return kDone;
}

}  // namespace

CLI::App* AddBackup(CLI::App* parent,
                    const std::string& name,
                    Context* context) {
  CLI::App* backup = parent->add_subcommand(
      name,
      "Copy the daemon's database to a file; the copy is consistent, and the "
      "daemon continues to serve");
  const auto path = std::make_shared<std::string>();
  const auto force = std::make_shared<bool>(false);
  backup->add_option("FILE", *path)->required();
  backup->add_flag("--force", *force, "Overwrite the file if it exists");
  backup->callback([context, path, force] {
    context->command = [context, path, force] {
      return Backup(context, *path, *force);
    };
  });
  return backup;
}

}  // namespace selfcal::client
