"""One step of Radau collocation for dp/dt = p Q: the polynomial whose defect u' - u Q vanishes at the Radau points.

The last of the s points is the end of the step. This is the method Radau IIA of order 2 s - 1, which damps what a step
does not resolve (Hairer & Wanner 1996, doi:10.1007/978-3-642-05221-7, section IV.5).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.support.interrupts import heard
from kinetics.support.packages import linalg, sparse, special

if TYPE_CHECKING:
    from scipy.sparse import csc_array


class RadauTables(NamedTuple):
    """Polynomials on [-1, 1] by Legendre coefficients (s + 1,), and by values at -1 and the s Radau points.

    derivative : (s + 1, s + 1) whole numbers, from coefficients to those of the derivative
    values : (s + 1, s + 1), from coefficients to values; coefficients is its inverse
    start : (s,) derivatives at the points, of what is 1 at -1 and 0 at the points
    rotation, triangle : (s, s) real Schur form of the derivatives at the points, of what is 0 at -1
    """

    derivative: Floats
    values: Floats
    coefficients: Floats
    start: Floats
    rotation: Floats
    triangle: Floats


@cache
def radau_tables(degree: int) -> RadauTables:
    """The tables of an even degree s, for which all eigenvalues are pairs.

    By Schur's form, which is orthogonal; eigenvectors would lose a digit with every two degrees.
    """
    from numpy.polynomial.legendre import legvander

    points = np.concatenate([[-1.0], special.roots_jacobi(degree - 1, 1, 0)[0], [1.0]])
    values = legvander(points, degree)
    coefficients = np.linalg.inv(values)
    low, high = np.meshgrid(np.arange(degree + 1), np.arange(degree + 1), indexing="ij")
    derivative = np.where((high > low) & ((high - low) % 2 == 1), 2.0 * low + 1.0, 0.0)
    slopes = (values @ derivative @ coefficients)[1:]
    triangle, rotation = linalg.schur(slopes[:, 1:], output="real")
    return RadauTables(derivative, values, coefficients, slopes[:, 0], rotation, triangle)


class RadauStep:
    """The equations of all steps of one length, factorised: a complex sparse LU for every two points.

    rates : (N, N) Q transposed, 1/tu, its states in the order in which they are eliminated. Its columns sum to zero, so
        that the diagonal dominates and no pivots are sought
    length : of the step, tu
    degree : s, even
    """

    def __init__(self, rates: csc_array, length: float, degree: int) -> None:

        self._tables = radau_tables(degree)
        # A block [[a, b], [c, a]] of the triangle acts on x + i r y, r**2 = -b / c, as its eigenvalue a + i r c does.
        above, below = np.diag(self._tables.triangle, 1)[::2], np.diag(self._tables.triangle, -1)[::2]
        self._ratios = np.sqrt(-above / below)
        poles = np.diag(self._tables.triangle)[::2] + 1j * self._ratios * below
        halved, one = rates * (length / 2.0), sparse.eye_array(rates.shape[0])
        self._factors: list[Any] = [_factorised(pole * one - halved) for pole in poles]

    def correction(self, defect: Floats, jump: Floats) -> Floats:
        """Coefficients (N, s + 1) of what makes the defect vanish at the points, and the jump, when added.

        defect : (N, s + 1) coefficients of u' - u Q h / 2
        jump : (N,) u at -1 minus what it should be
        """
        tables = self._tables
        # The collocation equations in Schur form, block by block from the last: a complex solve for every two points.
        wanted = (np.outer(jump, tables.start) - defect @ tables.values[1:].T) @ tables.rotation
        turned = np.empty_like(wanted)
        for block in range(len(self._factors) - 1, -1, -1):
            pair, later, ratio = slice(2 * block, 2 * block + 2), slice(2 * block + 2, None), self._ratios[block]
            right = wanted[:, pair] - turned[:, later] @ tables.triangle[pair, later].T
            solved = self._factors[block].solve(right[:, 0] + 1j * ratio * right[:, 1])
            turned[:, pair] = np.column_stack([solved.real, solved.imag / ratio])
        return np.column_stack([-jump, turned @ tables.rotation.T]) @ tables.coefficients.T


def fill(rates: csc_array) -> tuple[Ints, Ints]:
    """Numbers in each column (N,) of the lower factor and each row (N,) of the upper one, for Q transposed (N, N)."""
    factors = _factorised(float(-rates.diagonal().min(initial=-1.0)) * sparse.eye_array(rates.shape[0]) - rates)
    return factors.L.count_nonzero(axis=0), factors.U.count_nonzero(axis=1)


def _factorised(matrix: Any) -> Any:

    return heard(
        sparse.linalg.splu, sparse.csc_array(matrix), "NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
