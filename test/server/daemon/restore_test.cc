// A backup put in place of the database of a running daemon.
#include <gmock/gmock.h>

#include <filesystem>
#include <string>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

class RestoreTest : public DaemonTest {
 protected:
  // All its pieces, and their checksum.
  v1::RestoreStoreRequest Backup(std::string* sha256) {
    grpc::ClientContext context;
    const auto stub = v1::StoreService::NewStub(channel_);
    const auto reader = stub->BackupStore(&context, v1::BackupStoreRequest());
    v1::RestoreStoreRequest backup;
    v1::BackupStoreResponse response;
    while (reader->Read(&response)) {
      backup.mutable_data()->append(response.data());
      if (response.has_summary()) *sha256 = response.summary().sha256();
    }
    EXPECT_TRUE(reader->Finish().ok());
    return backup;
  }
};

TEST_F(RestoreTest, TheDaemonStartsAnewWithTheBackup) {
  const auto daemon = StartAndWait();
  const Rig rig = CreateRig();
  std::string sha256;
  const v1::RestoreStoreRequest backup = Backup(&sha256);
  Stream(TestSegments(rig, 2));
  ASSERT_EQ(Segments().segments_size(), 2);
  v1::RestoreStoreResponse restored;
  {
    grpc::ClientContext context;
    const auto stub = v1::StoreService::NewStub(channel_);
    const auto writer = stub->RestoreStore(&context, &restored);
    ASSERT_TRUE(writer->Write(backup));
    v1::RestoreStoreRequest end;
    end.set_sha256(sha256);
    writer->Write(end);
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  ASSERT_TRUE(
      daemon->Says("selfcald ready", "restart with the restored database"))
      << daemon->Log();
  Connect();
  EXPECT_EQ(Segments().segments_size(), 0);
  EXPECT_TRUE(std::filesystem::exists(restored.previous_database()));
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

}  // namespace
}  // namespace selfcal::server
