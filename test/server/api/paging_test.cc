#include "server/api/paging.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::server {
namespace {

// A list of texts of these sizes, which are read as reasons of versions.
class PagingTest : public ::testing::Test {
 protected:
  // Reads all pages of at most so many, and checks their sizes.
  std::vector<std::size_t> ReadAll(int page_size) {
    v1::ListCalibrationsRequest request;
    request.set_page_size(page_size);
    std::vector<std::size_t> read;
    do {
      const auto page = FillPage<v1::ListCalibrationsResponse>(
          request,
          "",
          [&](const Page& of) -> absl::StatusOr<Listed<std::string>> {
            ++fetched_;
            return Fetch(of);
          },
          [](const std::string& text, v1::ListCalibrationsResponse* to) {
            to->add_calibrations()->add_reasons(text);
            return absl::OkStatus();
          });
      EXPECT_TRUE(page.ok()) << page.status();
      if (!page.ok()) return read;
      ++pages_;
      EXPECT_GT(page->calibrations_size(), 0);
      EXPECT_TRUE(page->calibrations_size() == 1 ||
                  page->ByteSizeLong() <= kMaxPageBytes);
      for (const auto& one : page->calibrations()) {
        read.push_back(one.reasons(0).size());
      }
      request.set_page_token(page->next_page_token());
    } while (!request.page_token().empty());
    return read;
  }

  std::vector<std::size_t> sizes_;
  int fetched_ = 0;
  int pages_ = 0;

 private:
  Listed<std::string> Fetch(const Page& page) const {
    Listed<std::string> listed;
    std::size_t k = page.token.empty() ? 0 : std::stoul(page.token);
    const std::size_t end = std::min(sizes_.size(), k + page.size);
    for (; k < end; ++k) listed.items.emplace_back(sizes_[k], 'x');
    if (end < sizes_.size()) listed.next_token = std::to_string(end);
    return listed;
  }
};

TEST_F(PagingTest, LargeItemsComeInSmallerPages) {
  sizes_.assign(1000, 30'000);
  EXPECT_EQ(ReadAll(1000), sizes_);
  EXPECT_LE(pages_, 11);
  // Each page but the last is read once as a whole and once as it fits.
  EXPECT_LE(fetched_, 2 * pages_);
}

TEST_F(PagingTest, AnItemThatFitsNowhereComesAlone) {
  sizes_ = {10, 20, 2 * kMaxPageBytes, 30, 5 * kMaxPageBytes};
  EXPECT_EQ(ReadAll(50), sizes_);
}

TEST_F(PagingTest, SmallItemsAreReadOnce) {
  sizes_.assign(120, 100);
  EXPECT_EQ(ReadAll(50), sizes_);
  EXPECT_EQ(pages_, 3);
  EXPECT_EQ(fetched_, 3);
}

}  // namespace
}  // namespace selfcal::server
