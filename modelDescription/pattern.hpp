// Structure of a 3x3 matrix: which entries can differ from zero, and what changes them.
#pragma once

#include <cstdint>

#include "../src/math.hpp"

namespace tiefmu {

// Bit 3 * row + column. `moving` lies in `changing`, `changing` in `any`.
struct Pattern {
  std::uint16_t any = 0;       // may differ from zero
  std::uint16_t changing = 0;  // not known at build time: parameters or the motion change it
  std::uint16_t moving = 0;    // the motion changes it

  bool empty() const { return any == 0; }
};

inline constexpr Pattern identityPattern{0b100'010'001, 0, 0};
inline constexpr Pattern crossPattern{0b011'101'110, 0, 0};  // of u x (.)
inline constexpr Pattern fullPattern{0b111'111'111, 0, 0};
inline constexpr Pattern scalarPattern{0b001'001'001, 0, 0};  // column 0: a scalar that enters every component

constexpr Pattern moving(Pattern p) { return {p.any, p.any, p.any}; }
constexpr Pattern changing(Pattern p) { return {p.any, p.any, p.moving}; }

// Non-zero entries of a matrix known at build time.
inline Pattern patternOf(const Mat3& m) {
  Pattern p;
  for (int k = 0; k < 9; ++k)
    if (m(k / 3, k % 3) != 0) p.any |= static_cast<std::uint16_t>(1 << k);
  return p;
}

inline Pattern diagonalPattern(const Vec3& v) { return patternOf(v.asDiagonal().toDenseMatrix()); }

constexpr Pattern operator+(Pattern a, Pattern b) {
  return {static_cast<std::uint16_t>(a.any | b.any), static_cast<std::uint16_t>(a.changing | b.changing),
          static_cast<std::uint16_t>(a.moving | b.moving)};
}

constexpr std::uint16_t booleanProduct(std::uint16_t a, std::uint16_t b) {
  int product = 0;
  for (int k = 0; k < 9; ++k)
    if (a >> k & 1) product |= (b >> 3 * (k % 3) & 7) << 3 * (k / 3);
  return static_cast<std::uint16_t>(product);
}

// A product changes where either factor does.
constexpr Pattern operator*(Pattern a, Pattern b) {
  const auto changes = booleanProduct(a.changing, b.any) | booleanProduct(a.any, b.changing);
  const auto moves = booleanProduct(a.moving, b.any) | booleanProduct(a.any, b.moving);
  return {booleanProduct(a.any, b.any), static_cast<std::uint16_t>(changes), static_cast<std::uint16_t>(moves)};
}

constexpr std::uint16_t transposedBits(std::uint16_t bits) {
  int out = 0;
  for (int k = 0; k < 9; ++k)
    if (bits >> k & 1) out |= 1 << (3 * (k % 3) + k / 3);
  return static_cast<std::uint16_t>(out);
}

constexpr Pattern transposed(Pattern p) {
  return {transposedBits(p.any), transposedBits(p.changing), transposedBits(p.moving)};
}

}  // namespace tiefmu
