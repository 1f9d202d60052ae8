// The kinds of devices of the experiment on trust: what each is, and its seeds.
//
// The seeds that judge were chosen before any threshold of the estimator or the
// gate, and are never changed or used to choose one: for that, each kind has as
// many others (kDesign). A device is a function of its kind and its seed.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "test/evaluation/trust_device.h"

namespace selfcal {

enum class TrustSeeds { kJudging, kDesign };

struct TrustKind {
  std::string name;
  std::string about;
  std::uint64_t first_seed;  // of those that judge
  int devices;
  int quick_devices;
  // Nothing where a recording that it needs is missing.
  std::function<std::optional<TrustDevice>(std::uint64_t seed)> make;
  // The same device without the segments that are wrong, where results are to
  // agree; empty: no such device.
  std::function<std::optional<TrustDevice>(std::uint64_t seed)> clean = {};
};

// From the first seed of a kind to the first of its seeds for design.
inline constexpr std::uint64_t kDesignSeedOffset = 500;

inline std::uint64_t SeedOf(const TrustKind& kind, TrustSeeds seeds, int i) {
  return kind.first_seed + static_cast<std::uint64_t>(i) +
         (seeds == TrustSeeds::kDesign ? kDesignSeedOffset : 0);
}

// All of them: seeds of different kinds differ.
const std::vector<TrustKind>& TrustKinds();

// Parts of the list, each in a file of its own.
std::vector<TrustKind> MotionKinds();      // trust_motion_kinds.cc
std::vector<TrustKind> NoiseKinds();       // trust_noise_kinds.cc
std::vector<TrustKind> CorruptionKinds();  // trust_corruption_kinds.cc
std::vector<TrustKind> ChangeKinds();      // trust_change_kinds.cc
std::vector<TrustKind> ModelKinds();       // trust_model_kinds.cc
std::vector<TrustKind> RecordedKinds();    // trust_recorded_kinds.cc

}  // namespace selfcal
