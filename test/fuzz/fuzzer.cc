// The entry of libFuzzer, for the target that SELFCAL_FUZZ_TARGET names.
#include <cstddef>
#include <cstdint>

#include "test/fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  selfcal::SELFCAL_FUZZ_TARGET({reinterpret_cast<const char*>(data), size});
  return 0;
}
