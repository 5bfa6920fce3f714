"""Tallies over many runs: ranges, histograms whose bins widen, sums and sums of products."""

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled
def extend_range(counts, low, high):
    """Widen the ranges low, high (T, S) to hold the counts (runs, T, S)."""
    rows, lowest, highest = counts.reshape(counts.shape[0], low.size), low.ravel(), high.ravel()  # no copies
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            lowest[c] = min(lowest[c], rows[i, c])
            highest[c] = max(highest[c], rows[i, c])


@compiled
def fit_bins(low, high, n_bins, shift, origin):
    """Narrowest bins of 2**shift counts, `n_bins` of which hold low to high; the first one is number `origin`."""
    n_times, n_species = low.shape
    for t in range(n_times):
        for s in range(n_species):
            k = 0
            while (high[t, s] >> k) - (low[t, s] >> k) >= n_bins:
                k += 1
            shift[t, s], origin[t, s] = k, low[t, s] >> k


@compiled
def pour(source, shift, origin, target, new_shift, new_origin):
    """Add histograms (T, S, bins) to others whose bins are as wide or wider and hold them. Loses nothing: bins nest."""
    n_times, n_species, n_bins = source.shape
    for t in range(n_times):
        for s in range(n_species):
            by = new_shift[t, s] - shift[t, s]
            for b in range(n_bins):
                if source[t, s, b] > 0:
                    target[t, s, ((origin[t, s] + b) >> by) - new_origin[t, s]] += source[t, s, b]


@compiled
def rebin(histogram, shift, origin, new_shift, new_origin):
    """Put histograms (T, S, bins) into wider or moved bins, in place."""
    n_times, n_species, n_bins = histogram.shape
    row = np.empty(n_bins, dtype=np.int64)
    for t in range(n_times):
        for s in range(n_species):
            by = new_shift[t, s] - shift[t, s]
            if by == 0 and new_origin[t, s] == origin[t, s]:
                continue
            row[:] = histogram[t, s]
            histogram[t, s] = 0
            for b in range(n_bins):
                if row[b] > 0:
                    histogram[t, s, ((origin[t, s] + b) >> by) - new_origin[t, s]] += row[b]


@compiled
def tally(counts, shift, origin, histogram):
    """Count every value (runs, T, S) in its bin."""
    rows, shifts, origins = counts.reshape(counts.shape[0], shift.size), shift.ravel(), origin.ravel()
    bins = histogram.reshape(shift.size, histogram.shape[2])
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            bins[np.uint64(c), np.uint64((rows[i, c] >> shifts[c]) - origins[c])] += 1


@compiled
def add_squares(counts, reference, sums, squares):
    """Add deviations from the reference (T, S), and their squares (T, S). No sum may pass 2**63: see to it before."""
    rows, centres = counts.reshape(counts.shape[0], reference.size), reference.ravel()
    totals, all_squares = sums.ravel(), squares.ravel()
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            off = rows[i, c] - centres[c]
            totals[c] += off
            all_squares[c] += off * off


@compiled
def add_products(counts, reference, first, second, sums, products):
    """Add the products of counts of pairs of species `first`, `second` (P,) to `products` (T, P)."""
    runs, n_times, n_species = counts.shape
    off = np.empty(n_species, dtype=np.int64)
    for i in range(runs):
        for t in range(n_times):
            for s in range(n_species):
                off[s] = counts[i, t, s] - reference[t, s]
                sums[t, s] += off[s]
            for p in range(first.size):
                products[t, p] += off[first[p]] * off[second[p]]
