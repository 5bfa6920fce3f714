"""Exact answers of small chains and their derivatives, in fractions."""

from fractions import Fraction
from math import factorial


def solved(matrix, right):
    """x of matrix x = right in fractions, by elimination."""
    n = len(matrix)
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for c in range(n):
        pivot = next(r for r in range(c, n) if rows[r][c])
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [x / rows[c][c] for x in rows[c]]
        for r in range(n):
            if r != c and rows[r][c]:
                rows[r] = [x - rows[r][c] * y for x, y in zip(rows[r], rows[c], strict=True)]
    return [row[n] for row in rows]


def exact_moments(rates, shares, start, orders):
    """Moments of the time to the last state and their derivatives, in fractions."""
    given = [[Fraction(float(x)) for x in row] for row in rates]
    moved = [
        [x * Fraction(float(share)) for x, share in zip(*rows, strict=True)] for rows in zip(given, shares, strict=True)
    ]

    def leaving(table):
        n = len(table) - 1
        return [[sum(table[i]) if i == j else -table[i][j] for j in range(n)] for i in range(n)]

    def product(matrix, x):
        return [sum(a * b for a, b in zip(row, x, strict=True)) for row in matrix]

    n = len(rates) - 1
    values, slopes = [Fraction(1)] * n, [Fraction(0)] * n
    moments, derivatives = [], []
    for order in range(1, orders + 1):
        values = solved(leaving(given), values)
        right = [a - b for a, b in zip(slopes, product(leaving(moved), values), strict=True)]
        slopes = solved(leaving(given), right)
        for kept, found in ((moments, values), (derivatives, slopes)):
            kept.append(factorial(order) * sum(Fraction(float(p)) * x for p, x in zip(start, found, strict=False)))
    return moments, derivatives
