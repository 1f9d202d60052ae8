// The samples of one IMU that the builder holds for the segments to come.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::client {

class SampleQueue {
 public:
  // Returns false and ignores the sample if it is not later than the last one.
  // Throws std::bad_alloc.
  bool Add(const ImuSample& sample);

  bool empty() const { return samples_.empty(); }
  // Times of the first and the last sample, of which there must be one.
  std::int64_t begin_ns() const { return samples_.front().t_ns; }
  std::int64_t end_ns() const { return samples_.back().t_ns; }
  // True if there is a sample at or after the time.
  bool Reaches(std::int64_t t_ns) const;

  // Drops the samples before the last one that is at or before the time.
  void DropBefore(std::int64_t t_ns);

  // Returns an empty vector with the capacity that Release needs, so that
  // Release cannot fail. Throws std::bad_alloc.
  std::vector<ImuSample> Reserve() const;
  // Returns all samples, and keeps copies in `reserved` of those from the last
  // one that is at or before the time.
  std::vector<ImuSample> Release(std::int64_t t_ns,
                                 std::vector<ImuSample> reserved);

  void Free();  // drops all, with their memory

 private:
  std::vector<ImuSample> samples_;  // strictly increasing in time
};

}  // namespace selfcal::client
