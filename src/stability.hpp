// How large a step may be (theory 6).
#pragma once

#include <vector>

#include "dynamics.hpp"

namespace tiefmu {

// Largest stable step of a method on x'' = -omega^2 x - c x', s (1e30: none). For central difference and symplectic
// Euler with the damping force of the lagged half step that is 2/omega (sqrt(1 + z^2) - z), z = c / (2 omega).
double stableStep(Method method, double omega, double c);

// beta of the velocity v_(n-1/2) + beta (h/2) a_(n-1) that dampers see in a central difference step: the largest one of
// [0, 1] that step h (s) is stable with (0 where none is), theory (6.5). At beta = 1 the method is of second order.
double damperPrediction(double h, double omega, double c);

// Theory (6.3) of one node: sqrt(2 m/K), or sqrt(2 I/Kr), s (1e30: no stiffness).
double nodalStep(double inertia, double stiffness);

// Theory (6.3): the smallest sqrt(2 m/K), sqrt(2 I/Kr) over the free master nodes, s (1e30: no stiffness).
double nodalStep(const Model& model, const double* addedMass, const double* addedInertia, const double* stiffness,
                 const double* rotationalStiffness);

// Largest eigenvalue of M^-1 K (and of M^-1 C) of the free nodes by Lanczos in the inner product of M. The Ritz value
// is a lower bound; adding the norm of its residual gives the value that limits are computed from.
class Spectrum {
 public:
  explicit Spectrum(Dynamics& dynamics);
  struct Value {
    double ritz = 0;
    double residual = 0;  // |lambda - ritz| <= residual for an eigenvalue lambda, the largest one once converged
    double bound() const { return ritz + residual; }
  };
  // Until the residual is below 1e-9 of the value (1e-4 with over 3000 unknowns), or 40 restarts. Writes M x of the
  // mode to `mode` (if not null).
  Value largest(bool damping, double* mode);
  // A few Lanczos vectors started from `mode`, which is updated. No allocation.
  Value refresh(double* mode);

 private:
  Value lanczos(bool damping, double* mode, int vectors);
  void apply(const double* x, double* y, bool damping);  // y = K x
  void solve(const double* p, double* x);                // x = M^-1 p
  static constexpr int refreshVectors = 6;

  Dynamics& dynamics_;
  int size_;
  std::vector<double> basis_, image_;  // columns v_j and M v_j
  std::vector<double> u_, turn_, f_, t_;
};

}  // namespace tiefmu
