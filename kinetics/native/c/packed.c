/* States packed into one integer each, in rising order, and steps of their Markov chain without a stored matrix: what
 * packed.py does. A channel adds the same number to every key, so that sorted keys are joined by going through both. */

#include "streams.h"

enum { TILE = 128, MOST_SPECIES = 62 }; /* a key has 62 bits, and each species takes one at least */

/* Species s lies in the bits of masks[s] from shifts[s] on. A propensity by mass action is a coefficient times the factors
 * starts[r] to starts[r + 1], each a count minus `less`; `moved` is what the channel changes that count by. The checks
 * begins[r] to begins[r + 1] are of the species that a channel needs or changes. laws[r] is the row of a law's values, or -1. */
typedef struct {
    const int64_t *shifts, *masks, *starts, *species, *begins, *checked, *needed, *changes, *offsets, *laws;
    const double *less, *moved;
    int64_t n_channels, n_species;
} PackedChannels;

INLINE int64_t count_of(const PackedChannels *m, int64_t key, int64_t s)
{
    return (key >> m->shifts[s]) & m->masks[s];
}

/* The propensity of channel r in row i, which has this key. */
INLINE double rate_of(const PackedChannels *m, const double *coefficients, int64_t r, int64_t key, const double *table, int64_t i,
                      int64_t width)
{
    double rate = coefficients[r];
    if (m->laws[r] >= 0)
        return rate * table[m->laws[r] * width + i];
    for (int64_t f = m->starts[r]; f < m->starts[r + 1]; f++)
        rate *= (double)count_of(m, key, m->species[f]) - m->less[f];
    return rate;
}

/* Whether the counts, each changed `times` times as the channel changes it, are all from `needed` on and have room. */
INLINE int is_held(const PackedChannels *m, int64_t r, int64_t key, int64_t times, int is_needed)
{
    for (int64_t c = m->begins[r]; c < m->begins[r + 1]; c++) {
        const int64_t s = m->checked[c], count = count_of(m, key, s) + times * m->changes[c];
        if (count < (is_needed ? m->needed[c] : 0) || count > m->masks[s])
            return 0;
    }
    return 1;
}

/* For channels first to before last: the row from which each leads to every state, n where there is none among these. The
 * bit of each channel whose end is among them is set in `inside`, of which a row has n_words. */
void packed_sources(const PackedChannels *m, int64_t first, int64_t last, const int64_t *keys, int64_t n, const char *is_stopped,
                    const double *table, int32_t *sources, uint64_t *inside, int64_t n_words)
{
    for (int64_t r = first; r < last; r++) {
        int32_t *row = sources + r * n;
        const double *law = m->laws[r] < 0 ? 0 : table + m->laws[r] * (n + 1);
        for (int64_t i = 0, j = 0; i < n; i++) {
            const int64_t key = keys[i] - m->offsets[r];
            row[i] = (int32_t)n;
            if (!is_held(m, r, keys[i], -1, 1))
                continue;
            while (j < n && keys[j] < key)
                j++;
            if (j < n && keys[j] == key && !is_stopped[j] && (!law || law[j] > 0.0)) {
                row[i] = (int32_t)j;
                inside[j * n_words + r / 64] |= (uint64_t)1 << (r % 64);
            }
        }
    }
}

/* Of rows begin to before end: the sum of all propensities, and the bits of those that are above 0. */
void packed_exits(const PackedChannels *m, const double *coefficients, const int64_t *keys, int64_t begin, int64_t end, int64_t n,
                  const char *is_stopped, const double *table, double *exits, uint64_t *able, int64_t n_words)
{
    for (int64_t i = begin; i < end; i++) {
        double total = 0.0;
        for (int64_t r = 0; r < m->n_channels && !is_stopped[i]; r++) {
            const double rate = rate_of(m, coefficients, r, keys[i], table, i, n + 1);
            total += rate;
            if (rate > 0.0)
                able[i * n_words + r / 64] |= (uint64_t)1 << (r % 64);
        }
        exits[i] = total;
    }
}

/* What leads out of the set `keys` from other rows by the channels whose bits are set: key and flow, at least `floor`, of
 * each end. How many there are, of which `room` are written; -1 if a count has no room in a key. */
int64_t packed_spill(const PackedChannels *m, const double *coefficients, const int64_t *from, const double *vector,
                     const double *exits, const uint64_t *leads, int64_t n_words, int64_t n_from, const double *table,
                     double floor, const int64_t *keys, int64_t n, int64_t *ends, double *flows, int64_t room)
{
    int64_t found = 0;
    for (int64_t i = 0; i < n_from; i++) {
        if (vector[i] * exits[i] < floor)
            continue;
        for (int64_t r = 0; r < m->n_channels; r++) {
            if (!(leads[i * n_words + r / 64] >> (r % 64) & 1))
                continue;
            const double flow = vector[i] * rate_of(m, coefficients, r, from[i], table, i, n_from + 1);
            const int64_t key = from[i] + m->offsets[r];
            if (!(flow > 0.0 && flow >= floor))
                continue;
            if (!is_held(m, r, from[i], 1, 0))
                return -1;
            int64_t low = 0, high = n;
            while (low < high) {
                const int64_t middle = low + (high - low) / 2;
                if (keys[middle] < key)
                    low = middle + 1;
                else
                    high = middle;
            }
            if (low < n && keys[low] == key)
                continue;
            if (found < room) {
                ends[found] = key;
                flows[found] = flow;
            }
            found++;
        }
    }
    return found;
}

/* What flows into `width` rows from `from` on. */
CLONES static void inflow_of(const PackedChannels *m, const double *coefficients, const int64_t *keys, const int32_t *sources,
                             const double *table, int64_t n, int64_t from, int64_t width, const double *restrict now,
                             double *restrict inflow)
{
    double counts[MOST_SPECIES][TILE], rates[TILE];
    for (int64_t s = 0; s < m->n_species; s++) {
        const int64_t shift = m->shifts[s], mask = m->masks[s];
        if (mask <= INT32_MAX)
            for (int64_t j = 0; j < width; j++)
                counts[s][j] = (double)(int32_t)((keys[from + j] >> shift) & mask);
        else
            for (int64_t j = 0; j < width; j++)
                counts[s][j] = (double)((keys[from + j] >> shift) & mask);
    }
    for (int64_t j = 0; j < width; j++)
        inflow[j] = 0.0;
    for (int64_t r = 0; r < m->n_channels; r++) {
        const int32_t *restrict source = sources + r * n + from;
        const double coefficient = coefficients[r];
        const int64_t f = m->starts[r], n_factors = m->starts[r + 1] - f;
        if (m->laws[r] >= 0) {
            const double *law = table + m->laws[r] * (n + 1);
            for (int64_t j = 0; j < width; j++)
                inflow[j] += coefficient * law[source[j]] * now[source[j]];
            continue;
        }
        if (n_factors == 1) {
            const double *a = counts[m->species[f]], less = m->moved[f] + m->less[f];
            for (int64_t j = 0; j < width; j++)
                inflow[j] += coefficient * (a[j] - less) * now[source[j]];
            continue;
        }
        if (n_factors == 2) {
            const double *a = counts[m->species[f]], less = m->moved[f] + m->less[f];
            const double *b = counts[m->species[f + 1]], fewer = m->moved[f + 1] + m->less[f + 1];
            for (int64_t j = 0; j < width; j++)
                inflow[j] += coefficient * (a[j] - less) * (b[j] - fewer) * now[source[j]];
            continue;
        }
        for (int64_t j = 0; j < width; j++)
            rates[j] = coefficient;
        for (int64_t g = f; g < f + n_factors; g++)
            for (int64_t j = 0; j < width; j++)
                rates[j] *= counts[m->species[g]][j] - (m->moved[g] + m->less[g]);
        for (int64_t j = 0; j < width; j++)
            inflow[j] += rates[j] * now[source[j]];
    }
}

/* Steps b to before b + n_steps for rows begin to before end, all rows unless there is one step. Before each,
 * sums[t] += weights[t, b] now. events[tile] grows by tails[b] times what left its state. Row n of both vectors is 0, and
 * stands for all states outside. */
void packed_steps(const PackedChannels *m, const double *coefficients, const int64_t *keys, const int32_t *sources,
                  const double *exits, const double *table, int64_t n, int64_t begin, int64_t end, const double *weights,
                  const double *tails, int64_t n_sums, int64_t n_weights, int64_t b, int64_t n_steps, double *vector,
                  double *other, double *sums, double *events)
{
    double inflow[TILE], *now = vector, *after = other;
    for (int64_t step = b; step < b + n_steps; step++) {
        for (int64_t from = begin; from < end; from += TILE) {
            const int64_t width = end - from < TILE ? end - from : TILE;
            double left = 0.0;
            inflow_of(m, coefficients, keys, sources, table, n, from, width, now, inflow);
            for (int64_t j = 0; j < width; j++) {
                /* Not negative: a rounded product with exits <= 1 is no larger than the probability itself. */
                const double here = now[from + j], outflow = exits[from + j] * here;
                left += outflow;
                after[from + j] = here + (inflow[j] - outflow);
            }
            events[from / TILE] += tails[step] * left;
            for (int64_t t = 0; t < n_sums; t++) {
                const double weight = weights[t * n_weights + step];
                double *sum = sums + t * n + from;
                if (weight != 0.0)
                    for (int64_t j = 0; j < width; j++)
                        sum[j] += weight * now[from + j];
            }
        }
        double *swapped = now;
        now = after, after = swapped;
    }
    if (now != vector && n_steps > 1)
        memcpy(vector, now, (size_t)n * sizeof *vector);
}
