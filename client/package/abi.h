// libselfcal and the program that links it must agree on the layout of Eigen's
// types. With -mavx or -march=native Eigen aligns some of them to 32 bytes; the
// library aligns them to 16.
#pragma once

#include <Eigen/Geometry>

static_assert(alignof(Eigen::Quaterniond) == 16,
              "libselfcal aligns Eigen's types to 16 bytes: compile with "
              "-DEIGEN_MAX_STATIC_ALIGN_BYTES=16");
