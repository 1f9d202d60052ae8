# Cross-compiles for arm64 (aarch64) with Debian's compiler, against a root of
# Debian's arm64 packages that deploy/arm64-root makes. Tests run under qemu.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(SELFCAL_DEBIAN_ARCHITECTURE arm64)

set(SELFCAL_ARM64_ROOT "$ENV{SELFCAL_ARM64_ROOT}")
if(NOT IS_DIRECTORY "${SELFCAL_ARM64_ROOT}/usr/lib/aarch64-linux-gnu")
  message(FATAL_ERROR
      "SELFCAL_ARM64_ROOT names no root of arm64 packages: make one with "
      "deploy/arm64-root DIR, and set it in the environment")
endif()
set(CMAKE_SYSROOT ${SELFCAL_ARM64_ROOT})
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L ${SELFCAL_ARM64_ROOT})

# Libraries and headers from the root, programs (protoc) from this machine.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${SELFCAL_ARM64_ROOT})
set(ENV{PKG_CONFIG_LIBDIR}
    ${SELFCAL_ARM64_ROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${SELFCAL_ARM64_ROOT}/usr/share/pkgconfig)
