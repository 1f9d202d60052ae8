// One random stream (random.h) for each purpose of Simulate.
#pragma once

#include <cstdint>

namespace selfcal {

inline constexpr std::uint64_t kImuNoiseStream = 101;
inline constexpr std::uint64_t kBiasWalkStream = 102;
inline constexpr std::uint64_t kKeyframeTimeStream = 103;
inline constexpr std::uint64_t kTrackStream = 104;
inline constexpr std::uint64_t kPixelNoiseStream = 105;
inline constexpr std::uint64_t kOutlierStream = 106;
inline constexpr std::uint64_t kSlamStateStream = 107;
inline constexpr std::uint64_t kSlamLandmarkStream = 108;
inline constexpr std::uint64_t kPerturbStream = 109;
inline constexpr std::uint64_t kMovingLandmarkStream = 111;
inline constexpr std::uint64_t kBlurStream = 112;
inline constexpr std::uint64_t kPatchStream = 113;
inline constexpr std::uint64_t kLostSampleStream = 121;
inline constexpr std::uint64_t kSecondImuNoiseStream = 131;
inline constexpr std::uint64_t kSecondBiasWalkStream = 132;
inline constexpr std::uint64_t kSecondLostSampleStream = 133;

}  // namespace selfcal
