#include "client/recording/chunked_file.h"

#include <gtest/gtest.h>
#include <lz4frame.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

constexpr std::size_t kSize = 1000;

std::string Lz4(const std::string& content) {
  std::string bytes(2 * content.size() + 4096, '\0');
  bytes.resize(LZ4F_compressFrame(
      bytes.data(), bytes.size(), content.data(), content.size(), nullptr));
  return bytes;
}

class Chunks : public testing::Test {
 protected:
  // A file with a chunk of each letter.
  Chunks() {
    std::string bytes;
    for (const char letter : {'a', 'b', 'c', 'd'}) {
      const std::string chunk = Lz4(std::string(kSize, letter));
      chunks_.push_back(
          {bytes.size(), chunk.size(), kSize, Compression::kLz4, {}});
      bytes += chunk;
    }
    WriteBytes(path_, bytes);
  }

  std::unique_ptr<ChunkedFile> Open(std::size_t kept_bytes) {
    auto file = std::make_unique<ChunkedFile>(InputFile::Open(path_).value(),
                                              kept_bytes);
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
      std::int32_t number = -1;
      EXPECT_TRUE(file->AddChunk(chunks_[i], &number).ok());
      EXPECT_EQ(number, static_cast<std::int32_t>(i));
    }
    return file;
  }

  // The bytes in the middle of a chunk.
  static std::string Read(ChunkedFile* file, std::int32_t chunk) {
    const auto bytes = file->Read({chunk, 3, kSize / 2}, 3);
    return bytes.ok() ? std::string(*bytes) : "";
  }

  TempFolder folder_;
  const std::string path_ = folder_.File("chunks");
  std::vector<FileChunk> chunks_;
};

TEST_F(Chunks, AreReadInAnyOrderWhateverIsKept) {
  for (const std::size_t kept_bytes : {0u, 1500u, 2500u, 100000u}) {
    const auto file = Open(kept_bytes);
    for (const int chunk : {3, 0, 1, 0, 2, 2, 3, 1}) {
      EXPECT_EQ(Read(file.get(), chunk), std::string(3, "abcd"[chunk]));
    }
  }
}

TEST_F(Chunks, OnlyTheLastOnesAreKept) {
  const auto file = Open(2 * kSize);
  EXPECT_EQ(Read(file.get(), 2), "ccc");
  EXPECT_EQ(Read(file.get(), 0), "aaa");
  // Chunks that are not kept cannot be read from now on.
  std::filesystem::resize_file(path_, 0);
  EXPECT_EQ(Read(file.get(), 0), "aaa");
  EXPECT_EQ(Read(file.get(), 2), "ccc");
  EXPECT_EQ(Read(file.get(), 1), "");
  EXPECT_EQ(Read(file.get(), 3), "");
}

TEST_F(Chunks, MessagesMustBeInsideTheirChunk) {
  const auto file = Open(0);
  EXPECT_TRUE(file->Read({0, kSize, 0}, kSize).ok());
  EXPECT_FALSE(file->Read({0, kSize, 1}, kSize).ok());
  EXPECT_FALSE(file->Read({0, 1, kSize + 1}, 1).ok());
}

TEST_F(Chunks, CursorsOfFileAndMemoryGiveTheSameBytes) {
  std::string bytes;
  for (int i = 0; i < 100000; ++i) bytes.push_back(static_cast<char>(i * 7));
  WriteBytes(path_, bytes);
  const auto file = InputFile::Open(path_).value();
  RecordCursor on_disk(file.get(), 5, bytes.size());
  RecordCursor in_memory(std::string_view(bytes).substr(5));
  for (std::uint64_t size = 0; size < 700; ++size) {
    const auto a = on_disk.Take(size % 90);
    const auto b = in_memory.Take(size % 90);
    ASSERT_TRUE(a.ok() && b.ok());
    ASSERT_EQ(*a, *b);
    ASSERT_TRUE(on_disk.Skip(size % 50).ok());
    ASSERT_TRUE(in_memory.Skip(size % 50).ok());
  }
  EXPECT_EQ(on_disk.left(), in_memory.left());
  EXPECT_FALSE(on_disk.Take(on_disk.left() + 1).ok());
  EXPECT_FALSE(in_memory.Skip(in_memory.left() + 1).ok());
}

}  // namespace
}  // namespace selfcal::client
