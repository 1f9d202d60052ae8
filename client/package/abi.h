// libselfcal and who links it must lay out Eigen's types alike. With -mavx or
// -march=native Eigen aligns some of them to 32 bytes, the library to 16.
#pragma once

#include <Eigen/Geometry>

static_assert(alignof(Eigen::Quaterniond) == 16,
              "libselfcal has Eigen's types aligned to 16 bytes: compile with "
              "-DEIGEN_MAX_STATIC_ALIGN_BYTES=16");
