/* Channels as the samplers read them: see `sampling.merging.MergedChannels`. */

#ifndef WELLMIXED_SAMPLING_H
#define WELLMIXED_SAMPLING_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    const double *coefficients, *less, *terms; /* (G,), (G,), (M, 4) */
    const int64_t *first, *second, *factors;   /* (G,), (G,), (G, K, 3) */
    const char *is_general;                    /* (G,) */
    const int64_t *changes;                    /* (G, S) */
    int64_t n_channels, n_species, n_terms, n_sums, most_factors, n_blocks;
    int any_general;
} Model;

typedef struct {
    int outcome;
    int64_t run; /* the last one begun */
} EnsembleEnd;

/* Runs first_run, first_run + 1, ... one by one: the counts (runs, T, S) at the times of a grid. A negative outcome
 * says that there was no memory. */
EnsembleEnd direct(const Model *model, const int64_t *initial, const double *grid, int64_t n_times, const uint64_t *key,
              int64_t first_run, int64_t runs, int64_t *out);

/* The same runs, 64 side by side. */
EnsembleEnd lockstep(const Model *model, const int64_t *initial, const double *grid, int64_t n_times, const uint64_t *key,
                int64_t first_run, int64_t runs, int64_t *out);

#endif
