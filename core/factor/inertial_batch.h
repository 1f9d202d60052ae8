#pragma once
#include <span>
#include <vector>
#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial.h"
#include "core/simd/vector_width.h"
namespace selfcal {
struct InertialLinkStates { const KeyframeState* x0; const KeyframeState* x1; std::span<const ImuSample> samples; };
struct InertialNoiseRoot { double u[51]; };
struct InertialTransition : ChainTransition { double whitened[15]; };
class InertialBatch { public: explicit InertialBatch(VectorWidth) {}
 void Linearise(std::span<const InertialLinkStates>, const ImuCalibration&, const ImuNoise&, double gravity, std::span<InertialNoiseRoot> roots, bool compute_roots, InertialTransition* out);
};
}
