#include "test/rendering/texture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/simulation/random.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kLeafStream = 201;
constexpr int kLeafLog2Size = 12;
constexpr double kLeafTexel_m = 2.5e-3;
// Half the longer side of a leaf [texels]; the density of sizes falls with the
// third power, so that every scale covers the same area.
constexpr double kSmallestLeaf = 8;
constexpr double kLargestLeaf = 240;
constexpr double kLayers = 3;
constexpr double kDarkest = 20;
constexpr double kBrightest = 235;

class Canvas {
 public:
  explicit Canvas(int log2_size)
      : mask_((1 << log2_size) - 1),
        log2_size_(log2_size),
        texels_(std::size_t{1} << (2 * log2_size), 128) {}

  // Draws one leaf and returns its area [texels].
  double DrawLeaf(Random* random) {
    const double size = static_cast<double>(mask_ + 1);
    const double x = random->Uniform(0, size);
    const double y = random->Uniform(0, size);
    const double angle = random->Uniform(0, std::numbers::pi);
    const double largest = 1 / (kLargestLeaf * kLargestLeaf);
    const double smallest = 1 / (kSmallestLeaf * kSmallestLeaf);
    const double a =
        1 / std::sqrt(smallest + random->Uniform() * (largest - smallest));
    const double b = a * random->Uniform(0.3, 1);
    const double value = random->Uniform(kDarkest, kBrightest);
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const double reach_x = std::abs(c) * a + std::abs(s) * b + 1;
    const double reach_y = std::abs(s) * a + std::abs(c) * b + 1;
    const int first_row = static_cast<int>(std::floor(y - reach_y));
    const int last_row = static_cast<int>(std::ceil(y + reach_y));
    const int first_column = static_cast<int>(std::floor(x - reach_x));
    const int last_column = static_cast<int>(std::ceil(x + reach_x));
    for (int i = first_row; i <= last_row; ++i) {
      for (int j = first_column; j <= last_column; ++j) {
        const double dx = j + 0.5 - x;
        const double dy = i + 0.5 - y;
        const double outside = std::max(std::abs(c * dx + s * dy) - a,
                                        std::abs(c * dy - s * dx) - b);
        const double cover = std::clamp(0.5 - outside, 0.0, 1.0);
        if (cover > 0) Blend(i, j, cover, value);
      }
    }
    return 4 * a * b;
  }

  // Each texel becomes the mean of its neighbours with weights 1, 2, 1 along
  // both axes.
  void Smooth() {
    const std::vector<std::uint8_t> sharp = texels_;
    const auto at = [&](int i, int j) { return int{sharp[Index(i, j)]}; };
    for (int i = 0; i <= mask_; ++i) {
      for (int j = 0; j <= mask_; ++j) {
        const auto along = [&](int row) {
          return at(row, j - 1) + 2 * at(row, j) + at(row, j + 1);
        };
        texels_[Index(i, j)] = static_cast<std::uint8_t>(
            (along(i - 1) + 2 * along(i) + along(i + 1) + 8) / 16);
      }
    }
  }

  std::vector<std::uint8_t> Take() && { return std::move(texels_); }

 private:
  std::size_t Index(int i, int j) const {
    return (static_cast<std::size_t>(i & mask_) << log2_size_) +
           static_cast<std::size_t>(j & mask_);
  }
  void Blend(int i, int j, double cover, double value) {
    std::uint8_t& texel = texels_[Index(i, j)];
    texel = static_cast<std::uint8_t>(texel + cover * (value - texel) + 0.5);
  }

  int mask_;
  int log2_size_;
  std::vector<std::uint8_t> texels_;
};

}  // namespace

Texture::Texture(int log2_size,
                 double texel_m,
                 std::vector<std::uint8_t> texels)
    : texel_m_(texel_m) {
  Level finest;
  finest.texels = std::move(texels);
  finest.mask = (1 << log2_size) - 1;
  finest.log2_size = log2_size;
  levels_.push_back(std::move(finest));
  while (levels_.back().log2_size > 0) {
    const Level& fine = levels_.back();
    Level coarse;
    coarse.log2_size = fine.log2_size - 1;
    coarse.mask = fine.mask >> 1;
    coarse.scale = fine.scale / 2;
    coarse.texels.reserve(fine.texels.size() / 4);
    for (int i = 0; i <= coarse.mask; ++i) {
      const std::uint8_t* top = fine.texels.data() + Row(2 * i, fine);
      const std::uint8_t* bottom = fine.texels.data() + Row(2 * i + 1, fine);
      for (int j = 0; j <= coarse.mask; ++j) {
        const int sum =
            top[2 * j] + top[2 * j + 1] + bottom[2 * j] + bottom[2 * j + 1];
        coarse.texels.push_back(static_cast<std::uint8_t>((sum + 2) / 4));
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

Texture MakeLeafTexture(std::uint64_t seed) {
  Random random(seed, kLeafStream);
  Canvas canvas(kLeafLog2Size);
  double left = kLayers * std::pow(2.0, 2 * kLeafLog2Size);
  while (left > 0) left -= canvas.DrawLeaf(&random);
  canvas.Smooth();
  return {kLeafLog2Size, kLeafTexel_m, std::move(canvas).Take()};
}

Texture MakeCheckerTexture(int log2_size,
                           double texel_m,
                           int square,
                           std::uint8_t black,
                           std::uint8_t white) {
  const int size = 1 << log2_size;
  std::vector<std::uint8_t> texels;
  texels.reserve(std::size_t{1} << (2 * log2_size));
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const bool dark = (i / square + j / square) % 2 == 0;
      texels.push_back(dark ? black : white);
    }
  }
  return {log2_size, texel_m, std::move(texels)};
}

}  // namespace selfcal
