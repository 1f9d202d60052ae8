#include "client/selfcal/send_window.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "test/client/selfcal/test_segments.h"

namespace selfcal::client {
namespace {

// Sends what may be sent, and returns the indices.
std::vector<std::int64_t> SendAll(SendWindow* window) {
  std::vector<std::int64_t> sent;
  while (window->CanSend()) sent.push_back(KeyOf(*window->Next()).index);
  return sent;
}

using Indices = std::vector<std::int64_t>;

TEST(SendWindow, SendsInOrderAndNoMoreThanMayBeInFlight) {
  SendWindow window(3);
  for (std::uint64_t i = 0; i < 5; ++i) window.Append(Encoded(i));
  EXPECT_FALSE(window.CanSend()) << "there is no connection yet";
  window.Open();
  EXPECT_EQ(SendAll(&window), (Indices{0, 1, 2}));
  ASSERT_TRUE(window.Acknowledge({"walk", 0}).has_value());
  EXPECT_EQ(SendAll(&window), (Indices{3}));
  ASSERT_TRUE(window.Acknowledge({"walk", 2}).has_value());
  ASSERT_TRUE(window.Acknowledge({"walk", 1}).has_value());
  EXPECT_EQ(SendAll(&window), (Indices{4}));
  EXPECT_EQ(window.size(), 2u);
  EXPECT_EQ(window.resent(), 0u);
}

TEST(SendWindow, StartsOverWithTheOldestOnANewConnection) {
  SendWindow window(3);
  for (std::uint64_t i = 0; i < 5; ++i) window.Append(Encoded(i));
  window.Open();
  EXPECT_EQ(SendAll(&window), (Indices{0, 1, 2}));
  ASSERT_TRUE(window.Acknowledge({"walk", 0}).has_value());
  window.Close();
  EXPECT_FALSE(window.CanSend());
  window.Open();
  EXPECT_EQ(SendAll(&window), (Indices{1, 2, 3}));
  EXPECT_EQ(window.resent(), 2u) << "3 was not sent before";
}

TEST(SendWindow, AcknowledgesOnlyWhatIsInFlight) {
  SendWindow window(2);
  for (std::uint64_t i = 0; i < 3; ++i) window.Append(Encoded(i, i == 1));
  window.Open();
  EXPECT_EQ(SendAll(&window), (Indices{0, 1}));
  EXPECT_FALSE(window.Acknowledge({"walk", 2}).has_value()) << "not sent";
  EXPECT_FALSE(window.Acknowledge({"run", 0}).has_value());
  EXPECT_EQ(window.on_disk(), 1u);
  const auto acknowledged = window.Acknowledge({"walk", 1});
  ASSERT_TRUE(acknowledged.has_value());
  EXPECT_EQ(acknowledged->number, 1u);
  EXPECT_TRUE(acknowledged->on_disk);
  EXPECT_FALSE(window.Acknowledge({"walk", 1}).has_value()) << "is gone";
  EXPECT_EQ(window.on_disk(), 0u);
  window.Open();
  EXPECT_FALSE(window.Acknowledge({"walk", 0}).has_value())
      << "not sent on this connection";
  EXPECT_EQ(window.size(), 2u);
}

TEST(SendWindow, AcknowledgesTheFirstOfTwoWithTheSameKey) {
  SendWindow window(4);
  window.Append(Encoded(7));
  EncodedSegment again = Encoded(7);
  again.number = 8;
  window.Append(std::move(again));
  window.Open();
  SendAll(&window);
  EXPECT_EQ(window.Acknowledge({"walk", 7})->number, 7u);
  EXPECT_EQ(window.Acknowledge({"walk", 7})->number, 8u);
}

// Compares with a list in which each segment remembers what happened to it.
TEST(SendWindow, DoesTheSameAsAListOverRandomOperations) {
  struct Entry {
    std::int64_t index;
    bool in_flight;
    bool sent_before;
  };
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    const std::size_t max_in_flight = 1 + seed % 4;
    SendWindow window(max_in_flight);
    std::vector<Entry> list;
    bool open = false;
    std::uint64_t resent = 0;
    std::uint64_t next = 0;
    const auto next_to_send = [&] {
      std::size_t in_flight = 0;
      for (const Entry& entry : list) in_flight += entry.in_flight ? 1 : 0;
      const auto first =
          std::find_if(list.begin(), list.end(), [](const Entry& entry) {
            return !entry.in_flight;
          });
      return open && in_flight < max_in_flight ? first : list.end();
    };
    for (int step = 0; step < 500; ++step) {
      switch (random() % 8) {
        case 0:
        case 1:
          list.push_back({static_cast<std::int64_t>(next), false, false});
          window.Append(Encoded(next++));
          break;
        case 2:
          open = random() % 4 != 0;
          if (open) {
            window.Open();
            for (Entry& entry : list) entry.in_flight = false;
          } else {
            window.Close();
          }
          break;
        case 3:
        case 4: {  // an acknowledgement, also of what is unknown
          if (next == 0) break;
          const auto index = static_cast<std::int64_t>(random() % next);
          const auto entry =
              std::find_if(list.begin(), list.end(), [&](const Entry& known) {
                return known.index == index && known.in_flight;
              });
          const auto gone = window.Acknowledge({"walk", index});
          ASSERT_EQ(gone.has_value(), entry != list.end());
          if (entry == list.end()) break;
          EXPECT_EQ(gone->key.index, index);
          list.erase(entry);
          break;
        }
        default: {
          const auto entry = next_to_send();
          ASSERT_EQ(window.CanSend(), entry != list.end());
          if (entry == list.end()) break;
          EXPECT_EQ(KeyOf(*window.Next()).index, entry->index);
          resent += entry->sent_before ? 1 : 0;
          entry->in_flight = entry->sent_before = true;
        }
      }
      ASSERT_EQ(window.size(), list.size());
      ASSERT_EQ(window.resent(), resent);
    }
    for (const Entry& entry : list) {
      EXPECT_EQ(window.TakeOldest()->key.index, entry.index);
    }
    EXPECT_FALSE(window.TakeOldest().has_value());
    EXPECT_GT(resent, 0u);
  }
}

}  // namespace
}  // namespace selfcal::client
