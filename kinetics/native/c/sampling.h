/* Channels as the samplers read them: see `sampling.merging.MergedChannels`. */

#ifndef WELLMIXED_SAMPLING_H
#define WELLMIXED_SAMPLING_H

#include <stddef.h>
#include <stdint.h>

/* Candidates of a network in a crowd: see `sampling.crowds.Thinning`. */
typedef struct {
    const double *coefficients, *less, *slopes;  /* (R,) */
    const double *weights, *volumes, *factors;   /* (S,), (S,), (R, D) */
    const int64_t *spans, *partners;             /* (G + 1,), (R,) */
    double ratio;
    int64_t first, n_powers;
} Thinning;

typedef struct {
    const double *coefficients, *less, *terms; /* (G,), (G,), (M, 4) */
    const int64_t *first, *second, *factors;   /* (G,), (G,), (G, K, 3) */
    const char *is_general;                    /* (G,) */
    const int64_t *changes;                    /* (G, S) */
    int64_t n_channels, n_species, n_terms, n_sums, most_factors, n_blocks;
    int any_general;
    const Thinning *thinning; /* NULL without a crowd */
} Model;

/* The condition at which runs end: see `ensemble_work.Stop`, whose table has these entries of a comparison. */
enum { LOW, HIGH, YES, NO, N_TERMS, TERMS };
typedef struct {
    const char *affects_stop; /* (G + 1,) */
    const double *table;
} Stop;

#define HOLDS (-1)
#define MOST_STILL 1000.0 /* events in a row that do not move the clock: as in clock.py */

#endif
