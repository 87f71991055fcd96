// Start of a shocked interface for Athena++, its adaptive refinement, and what it writes at the end:
// the frame is that of the interface after the shock; numbers are in the block <problem>.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "../athena.hpp"
#include "../athena_arrays.hpp"
#include "../coordinates/coordinates.hpp"
#include "../eos/eos.hpp"
#include "../hydro/hydro.hpp"
#include "../mesh/mesh.hpp"
#include "../parameter_input.hpp"

namespace {
Real threshold;
const int SAMPLES = 16;  // of a cell's height, where the interface cuts it

// Refine where neighbouring cells differ by more than the threshold, in density or pressure.
int Refine(MeshBlock *block) {
  AthenaArray<Real> &w = block->phydro->w;
  Real most = 0.0;
  for (int j = block->js - 1; j <= block->je + 1; ++j) {
    for (int i = block->is - 1; i <= block->ie + 1; ++i) {
      for (int n : {static_cast<int>(IDN), static_cast<int>(IPR)}) {
        Real here = w(n, block->ks, j, i);
        most = std::max(most, std::abs(w(n, block->ks, j, i + 1) - here) / here);
        most = std::max(most, std::abs(w(n, block->ks, j + 1, i) - here) / here);
      }
    }
  }
  return most > threshold ? 1 : (most < 0.25 * threshold ? -1 : 0);
}
}  // namespace

void Mesh::InitUserMeshData(ParameterInput *pin) {
  threshold = pin->GetOrAddReal("problem", "threshold", 0.05);
  if (adaptive) EnrollUserRefinementCondition(Refine);
}

void MeshBlock::ProblemGenerator(ParameterInput *pin) {
  Real a0 = pin->GetReal("problem", "a0"), front = pin->GetReal("problem", "shock");
  Real gm1 = peos->GetGamma() - 1.0;
  Real left[3], right[3], heavy[3];
  for (int n = 0; n < 3; ++n) {
    std::string number = std::to_string(n);
    left[n] = pin->GetReal("problem", "left" + number);
    right[n] = pin->GetReal("problem", "right" + number);
    heavy[n] = pin->GetReal("problem", "heavy" + number);
  }
  for (int j = js; j <= je; ++j) {
    Real y0 = pcoord->x2f(j), dy = pcoord->dx2f(j);
    for (int i = is; i <= ie; ++i) {
      Real share = 0.0;
      for (int k = 0; k < SAMPLES; ++k) {
        Real line = a0 * std::cos(TWO_PI * (y0 + (k + 0.5) / SAMPLES * dy));
        Real part = (pcoord->x1f(i + 1) - line) / pcoord->dx1f(i);
        share += std::min(1.0, std::max(0.0, part)) / SAMPLES;
      }
      Real s[3];
      for (int n = 0; n < 3; ++n) {
        s[n] = pcoord->x1v(i) < front ? left[n] : right[n] + (heavy[n] - right[n]) * share;
      }
      phydro->u(IDN, ks, j, i) = s[0];
      phydro->u(IM1, ks, j, i) = s[0] * s[1];
      phydro->u(IM2, ks, j, i) = phydro->u(IM3, ks, j, i) = 0.0;
      phydro->u(IEN, ks, j, i) = s[2] / gm1 + 0.5 * s[0] * s[1] * s[1];
    }
  }
}

// x, y, size and density of all cells, as doubles.
void Mesh::UserWorkAfterLoop(ParameterInput *pin) {
  std::FILE *file = std::fopen("end.bin", "wb");
  for (int b = 0; b < nblocal; ++b) {
    MeshBlock *block = my_blocks(b);
    for (int j = block->js; j <= block->je; ++j) {
      for (int i = block->is; i <= block->ie; ++i) {
        double cell[4] = {block->pcoord->x1v(i), block->pcoord->x2v(j), block->pcoord->dx1f(i),
                          block->phydro->w(IDN, block->ks, j, i)};
        std::fwrite(cell, sizeof(double), 4, file);
      }
    }
  }
  std::fclose(file);
}
