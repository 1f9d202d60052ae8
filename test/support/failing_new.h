// A global operator new that fails on demand. For one source file of a program
// of its own: it replaces operator new in all of the program.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>

namespace selfcal {

// Allocations of this thread until one fails; below 0 none does.
inline thread_local int until_failure = -1;

inline void* Allocate(std::size_t size) {
  if (until_failure == 0) {
    until_failure = -1;
    throw std::bad_alloc();
  }
  if (until_failure > 0) --until_failure;
  void* memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

// Runs the call with an allocation that fails. True if the call met the
// failure.
template <typename Call>
bool Fails(int allocation, const Call& call) {
  until_failure = allocation;
  call();
  const bool failed = until_failure < 0;
  until_failure = -1;
  return failed;
}

}  // namespace selfcal

// Where g++ inlines one of a pair alone, it warns that they do not match.
[[gnu::noinline]] void operator delete(void* memory) noexcept;
[[gnu::noinline]] void operator delete[](void* memory) noexcept;
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept;
[[gnu::noinline]] void operator delete[](void* memory, std::size_t) noexcept;

void* operator new(std::size_t size) { return selfcal::Allocate(size); }
void* operator new[](std::size_t size) { return selfcal::Allocate(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept {
  std::free(memory);
}
