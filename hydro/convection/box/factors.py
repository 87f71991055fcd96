"""Sparse LU with the diagonal as pivots, checked, and with partial pivoting where that fails.

The matrices of `hydro.convection.box.equations` have symmetric patterns and large diagonals.  With
the diagonal as pivots the elimination can follow a minimum-degree ordering of the pattern, which at
160 x 160 cells is three times as fast as column ordering with row exchanges.  A pivot that is too
small shows in the residual of the solution; such a matrix is factorised again with exchanges.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from regrid.errors import RunFailure

TOLERANCE = 1e-6  # of the residual of a solution, relative to the right-hand side


class Factors:
    """LU of a square sparse matrix; `solve(b)` as often as wanted."""

    def __init__(self, matrix: sparse.spmatrix, what: str = "matrix"):
        """Factorise; `what` names the matrix in messages.  Raises RunFailure if it is singular."""
        self.matrix = matrix.tocsc()
        self.what = what
        self.exchanged = False
        try:
            self._factors = splu(
                self.matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:
            self._exchange_rows()

    def _exchange_rows(self) -> None:
        self.exchanged = True
        try:
            self._factors = splu(self.matrix)
        except RuntimeError as error:
            words = f"convection: the {self.what} is singular"
            raise RunFailure(words, cause="singular") from error

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution (n,) for `right` (n,); raises RunFailure where none of use is found."""
        solution = self._factors.solve(right)
        if not self._is_good(solution, right) and not self.exchanged:
            self._exchange_rows()
            solution = self._factors.solve(right)
        if not self._is_good(solution, right):
            words = f"convection: the {self.what} is singular to working precision"
            raise RunFailure(words, cause="singular")
        return solution

    def _is_good(self, solution: np.ndarray, right: np.ndarray) -> bool:
        residual = np.abs(self.matrix @ solution - right).max()
        return bool(residual <= TOLERANCE * np.abs(right).max())
