// A periodic grey texture with its levels of detail, each the mean of 2 x 2
// texels of the one below.
//
// Immutable: any thread may read it. The same seed gives the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace selfcal {

class Texture {
 public:
  // `texels` has 2^log2_size rows of as many texels; texel (i, j) covers
  // [j, j + 1] x [i, i + 1] texel_m.
  Texture(int log2_size, double texel_m, std::vector<std::uint8_t> texels);

  double texel_m() const { return texel_m_; }
  int levels() const { return static_cast<int>(levels_.size()); }

  // Value from 0 to 255 at (u, v), in texels of the finest level, interpolated
  // between the texels of a level. Requires 1 <= u, v < 2^20 and
  // 0 <= level < levels().
  float At(float u, float v, int level) const {
    const Level& from = levels_[static_cast<std::size_t>(level)];
    const float x = u * from.scale + kShift;
    const float y = v * from.scale + kShift;
    const int column = static_cast<int>(x);
    const int row = static_cast<int>(y);
    const float a = x - static_cast<float>(column);
    const float b = y - static_cast<float>(row);
    const int left = column & from.mask;
    const int right = (column + 1) & from.mask;
    const std::uint8_t* top = from.texels.data() + Row(row & from.mask, from);
    const std::uint8_t* bottom =
        from.texels.data() + Row((row + 1) & from.mask, from);
    const auto t0 = static_cast<float>(top[left]);
    const auto t1 = static_cast<float>(top[right]);
    const auto b0 = static_cast<float>(bottom[left]);
    const auto b1 = static_cast<float>(bottom[right]);
    const float t = t0 + a * (t1 - t0);
    return t + b * (b0 + a * (b1 - b0) - t);
  }

 private:
  struct Level {
    std::vector<std::uint8_t> texels;
    float scale = 1;
    int mask = 0;
    int log2_size = 0;
  };
  // Centres of texels are at halves; a multiple of every size keeps
  // coordinates positive.
  static constexpr float kShift = 4096 - 0.5F;

  static std::size_t Row(int row, const Level& level) {
    return static_cast<std::size_t>(row) << level.log2_size;
  }

  double texel_m_;
  std::vector<Level> levels_;
};

// Randomly turned rectangles of many sizes that cover each other, as dead
// leaves do: corners at every scale, as in images of rooms (Lee, Mumford and
// Huang 2001). 4096 x 4096 texels of 2.5 mm; edges are two texels wide.
Texture MakeLeafTexture(std::uint64_t seed);

// Squares of `square` texels, a power of two, black and white in turn, from the
// origin.
Texture MakeCheckerTexture(int log2_size,
                           double texel_m,
                           int square,
                           std::uint8_t black,
                           std::uint8_t white);

}  // namespace selfcal
