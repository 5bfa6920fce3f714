/* Tallies over many runs: what statistics.py does. n cells, one a time and species, where not said otherwise. */

#include <stdint.h>

/* Extend the range of each cell by the counts of more runs. */
void extend_range(const int64_t *counts, int64_t runs, int64_t n, int64_t *low, int64_t *high)
{
    for (int64_t i = 0; i < runs; i++)
        for (int64_t c = 0; c < n; c++) {
            const int64_t count = counts[i * n + c];
            low[c] = count < low[c] ? count : low[c];
            high[c] = count > high[c] ? count : high[c];
        }
}

/* Bins of width 2**shift, the narrowest with which n_bins of them hold the range; origin is the first bin. */
void fit_bins(const int64_t *low, const int64_t *high, int64_t n, int64_t n_bins, int64_t *shift, int64_t *origin)
{
    for (int64_t c = 0; c < n; c++) {
        int64_t k = 0;
        while ((high[c] >> k) - (low[c] >> k) >= n_bins)
            k++;
        shift[c] = k;
        origin[c] = low[c] >> k;
    }
}

/* Move histograms to wider bins, or to another origin. */
void rebin(int64_t *histogram, int64_t n, int64_t n_bins, const int64_t *shift, const int64_t *origin,
           const int64_t *new_shift, const int64_t *new_origin, int64_t *row)
{
    for (int64_t c = 0; c < n; c++) {
        const int64_t by = new_shift[c] - shift[c];
        int64_t *bins = histogram + c * n_bins;
        if (by == 0 && new_origin[c] == origin[c])
            continue;
        for (int64_t b = 0; b < n_bins; b++) {
            row[b] = bins[b];
            bins[b] = 0;
        }
        for (int64_t b = 0; b < n_bins; b++)
            if (row[b] > 0)
                bins[((origin[c] + b) >> by) - new_origin[c]] += row[b];
    }
}

/* Count runs into the bins. */
void tally(const int64_t *counts, int64_t runs, int64_t n, int64_t n_bins, const int64_t *shift, const int64_t *origin,
           int64_t *histogram)
{
    for (int64_t i = 0; i < runs; i++)
        for (int64_t c = 0; c < n; c++)
            histogram[c * n_bins + (counts[i * n + c] >> shift[c]) - origin[c]]++;
}

/* Sums and products of counts less a reference count, which keeps them small enough to be exact. */
void add_products(const int64_t *counts, int64_t runs, int64_t n_times, int64_t n_species, const int64_t *reference,
                  const int64_t *first, const int64_t *second, int64_t n_pairs, int64_t *sums, int64_t *products,
                  int64_t *off)
{
    for (int64_t i = 0; i < runs; i++)
        for (int64_t t = 0; t < n_times; t++) {
            const int64_t *here = counts + (i * n_times + t) * n_species;
            for (int64_t s = 0; s < n_species; s++) {
                off[s] = here[s] - reference[t * n_species + s];
                sums[t * n_species + s] += off[s];
            }
            for (int64_t p = 0; p < n_pairs; p++)
                products[t * n_pairs + p] += off[first[p]] * off[second[p]];
        }
}
