#include "client/recording/decompress.h"

#include <bzlib.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zstd.h>

#include <random>
#include <string>

namespace selfcal::client {
namespace {

std::string Compressed(Compression compression, const std::string& content) {
  std::string bytes(2 * content.size() + 4096, '\0');
  if (compression == Compression::kLz4) {
    bytes.resize(LZ4F_compressFrame(
        bytes.data(), bytes.size(), content.data(), content.size(), nullptr));
  } else if (compression == Compression::kZstd) {
    bytes.resize(ZSTD_compress(
        bytes.data(), bytes.size(), content.data(), content.size(), 1));
  } else {
    auto size = static_cast<unsigned>(bytes.size());
    BZ2_bzBuffToBuffCompress(bytes.data(),
                             &size,
                             const_cast<char*>(content.data()),
                             static_cast<unsigned>(content.size()),
                             1,
                             0,
                             0);
    bytes.resize(size);
  }
  return bytes;
}

std::string Content(std::size_t size) {
  std::mt19937 random(1);
  std::string content;
  for (std::size_t i = 0; i < size; ++i) {
    content.push_back(static_cast<char>(random() % 16));
  }
  return content;
}

class Decompression : public testing::TestWithParam<Compression> {};

TEST_P(Decompression, GivesTheContentOfAnySize) {
  for (const std::size_t size : {0u, 1u, 1000u, 65536u, 65537u, 1000000u}) {
    const std::string content = Content(size);
    const auto back =
        Decompress(GetParam(), Compressed(GetParam(), content), size);
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, content);
  }
}

TEST_P(Decompression, RefusesAnotherSizeThanIsStated) {
  const std::string bytes = Compressed(GetParam(), Content(1000));
  for (const std::size_t size : {0u, 999u, 1001u, 200'000'000u}) {
    EXPECT_EQ(Decompress(GetParam(), bytes, size).status().code(),
              absl::StatusCode::kDataLoss)
        << size;
  }
}

TEST_P(Decompression, RefusesMoreThanTheLimit) {
  const std::string bytes = Compressed(GetParam(), Content(1000));
  const auto back = Decompress(GetParam(), bytes, kMaxChunkBytes + 1);
  EXPECT_EQ(back.status().message(),
            "a chunk of 268435457 bytes is larger than the 268435456 allowed");
}

// A small file that becomes gigabytes must not be let.
TEST_P(Decompression, StopsBehindTheStatedSize) {
  const std::string bytes =
      Compressed(GetParam(), std::string(std::size_t{100} << 20, 'a'));
  const auto back = Decompress(GetParam(), bytes, 1000);
  EXPECT_EQ(back.status().message(),
            "the content is not of the 1000 bytes that are stated");
}

TEST_P(Decompression, RefusesWhatIsCutOff) {
  const std::string bytes = Compressed(GetParam(), Content(1000));
  for (std::size_t size = 0; size < bytes.size() / 2; size += 7) {
    EXPECT_FALSE(Decompress(GetParam(), bytes.substr(0, size), 1000).ok());
  }
}

TEST_P(Decompression, DamageDoesNotAbort) {
  const std::string bytes = Compressed(GetParam(), Content(3000));
  std::mt19937 random(1);
  int failed = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = bytes;
    damaged[random() % bytes.size()] ^= static_cast<char>(1 << random() % 8);
    const auto back = Decompress(GetParam(), damaged, 3000);
    failed += !back.ok();
    if (back.ok()) {
      EXPECT_EQ(back->size(), 3000u);
    }
  }
  EXPECT_GT(failed, 0);
}

INSTANTIATE_TEST_SUITE_P(All,
                         Decompression,
                         testing::Values(Compression::kLz4,
                                         Compression::kZstd,
                                         Compression::kBzip2));

}  // namespace
}  // namespace selfcal::client
