#include "server/grpc/memory_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/grpc/read_gate.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

const auto kNever = [] { return false; };
const auto kAtOnce = [] { return true; };

TEST(MemoryPool, SharesAreReturnedAtTheirEndOrBefore) {
  MemoryPool pool(1600);
  {
    auto share = pool.Acquire(800, kNever);
    EXPECT_EQ(pool.held(), 800);
    share->Shrink(200);
    EXPECT_EQ(pool.held(), 200);
    share->Shrink(900);
    EXPECT_EQ(share->bytes(), 200);
    MemoryPool::Share other = *std::move(share);
    EXPECT_EQ(pool.held(), 200);
    other = MemoryPool::Share();
    EXPECT_EQ(pool.held(), 0);
  }
  EXPECT_EQ(pool.held(), 0);
}

TEST(MemoryPool, LargeSharesLeaveRoomForSmallOnes) {
  MemoryPool pool(1600);
  const auto first = pool.Acquire(700, kNever);
  const auto second = pool.Acquire(700, kNever);
  EXPECT_FALSE(pool.Acquire(101, kAtOnce).has_value());
  const auto small = pool.Acquire(100, kNever);
  EXPECT_TRUE(small.has_value());
  EXPECT_TRUE(pool.Acquire(100, kNever).has_value());
}

TEST(MemoryPool, OneThatIsLargerThanThePoolIsGivenAlone) {
  MemoryPool pool(1600);
  {
    const auto whole = pool.Acquire(5000, kNever);
    EXPECT_TRUE(whole.has_value());
    EXPECT_FALSE(pool.Acquire(200, kAtOnce).has_value());
    // Small ones never wait for it.
    EXPECT_TRUE(pool.Acquire(100, kNever).has_value());
  }
  EXPECT_TRUE(pool.Acquire(5000, kNever).has_value());
}

TEST(MemoryPool, LargeSharesAreGivenInTheirOrderAndUrgentOnesFirst) {
  MemoryPool pool(1600);
  auto held = pool.Acquire(1600, kNever);
  std::atomic<int> begun{0};
  std::mutex mutex;
  std::vector<std::string> order;
  std::vector<std::thread> threads;
  for (const auto& [name, is_urgent] : {std::pair("first", false),
                                        std::pair("second", false),
                                        std::pair("urgent", true)}) {
    threads.emplace_back([&, name = std::string(name), urgent = is_urgent] {
      // Asked only once it waits.
      bool waits = false;
      const auto share = pool.Acquire(
          1600,
          [&] {
            if (!std::exchange(waits, true)) ++begun;
            return false;
          },
          urgent);
      const std::lock_guard lock(mutex);
      order.push_back(name);
    });
    const int expected = static_cast<int>(threads.size());
    ASSERT_TRUE(Eventually([&] { return begun == expected; }));
  }
  held.reset();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<std::string>{"urgent", "first", "second"}));
}

TEST(ReadGate, AnIdleStreamHoldsUpNobody) {
  ReadGate gate(1 << 26, 1 << 26);
  auto idle = gate.Enter(0, kNever);
  ASSERT_TRUE(idle.has_value());
  EXPECT_FALSE(gate.Enter(0, kAtOnce).has_value());
  // The heap does not grow.
  idle->Look();
  EXPECT_FALSE(idle->held());
  EXPECT_TRUE(gate.Enter(0, kNever).has_value());
}

TEST(ReadGate, AReadThatBringsALargeMessageKeepsItsReservation) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the allocator of a sanitizer does not report its heap";
#endif
  ReadGate gate(1 << 26, 1 << 26);
  auto busy = gate.Enter(0, kNever);
  ASSERT_TRUE(busy.has_value());
  const std::vector<char> received(1 << 23, 'x');
  busy->Look();
  EXPECT_TRUE(busy->held());
  EXPECT_FALSE(gate.Enter(0, kAtOnce).has_value());
  // A stream of small messages does not wait.
  EXPECT_TRUE(gate.Enter(100'000, kNever).has_value());
  busy->End();
  EXPECT_TRUE(gate.Enter(0, kNever).has_value());
}

}  // namespace
}  // namespace selfcal::server
