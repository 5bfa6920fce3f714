/* What is left of linear equations by a solution, in double-double arithmetic: what residuals.py does, to the last bit.
 * No addition may be fused with a product here, hence -ffp-contract=off. */

#include <math.h>
#include <stdint.h>

typedef struct {
    double high, low;
} Pair;

/* The sum of two doubles and its rounding error, exactly (Knuth). */
static Pair two_sum(double a, double b)
{
    const double total = a + b, part = total - a;
    return (Pair){total, (a - (total - part)) + (b - part)};
}

/* The product of two doubles and its rounding error, exactly (Dekker), by halves of 26 bits (Veltkamp). */
static Pair two_product(double a, double b)
{
    const double product = a * b;
    double c = 134217729.0 * a; /* 2**27 + 1 */
    const double a_high = c - (c - a), a_low = a - a_high;
    c = 134217729.0 * b;
    const double b_high = c - (c - b), b_low = b - b_high;
    return (Pair){product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low};
}

/* A double times a pair. */
static Pair scaled(double a, Pair x)
{
    const Pair product = two_product(a, x.high);
    return two_sum(product.high, product.low + a * x.low);
}

/* The sum of two pairs, with a relative error of at most 2**-104. */
static Pair added(Pair x, Pair y)
{
    Pair total = two_sum(x.high, y.high);
    const Pair lower = two_sum(x.low, y.low);
    total = two_sum(total.high, total.low + lower.high);
    return two_sum(total.high, total.low + lower.low);
}

static Pair minus(Pair x)
{
    return (Pair){-x.high, -x.low};
}

/* Take leaving_i x_i off every residual; `sizes` sums what was taken off or added, for the bound on rounding. */
static void leave(const double *leaving, int64_t n, const double *high, const double *low, Pair *left, double *sizes)
{
    for (int64_t i = 0; i < n; i++) {
        left[i] = added(left[i], minus(scaled(leaving[i], (Pair){high[i], low[i]})));
        sizes[i] += leaving[i] * fabs(high[i]);
    }
}

/* The residual of A x: by differences x_i - x_j, so that an exit rate is never summed and subtracted again. */
void accumulated(const int64_t *rows, const int64_t *columns, const double *rates, int64_t n_rates, const double *leaving,
            int64_t n, const double *high, const double *low, Pair *left, double *sizes)
{
    leave(leaving, n, high, low, left, sizes);
    for (int64_t k = 0; k < n_rates; k++) {
        const int64_t i = rows[k], j = columns[k];
        const Pair difference = added((Pair){high[i], low[i]}, (Pair){-high[j], -low[j]});
        left[i] = added(left[i], minus(scaled(rates[k], difference)));
        sizes[i] += rates[k] * (fabs(high[i]) + fabs(high[j]));
    }
}

/* The residual of x A: each flow leaves state i and enters state j. */
void occupied(const int64_t *rows, const int64_t *columns, const double *rates, int64_t n_rates, const double *leaving,
              int64_t n, const double *high, const double *low, Pair *left, double *sizes)
{
    leave(leaving, n, high, low, left, sizes);
    for (int64_t k = 0; k < n_rates; k++) {
        const int64_t i = rows[k], j = columns[k];
        const Pair flow = scaled(rates[k], (Pair){high[i], low[i]});
        left[i] = added(left[i], minus(flow));
        left[j] = added(left[j], flow);
        sizes[i] += fabs(flow.high);
        sizes[j] += fabs(flow.high);
    }
}

/* Add a correction to a solution in pairs. */
void corrected(double *high, double *low, const double *change, int64_t n)
{
    for (int64_t i = 0; i < n; i++) {
        const Pair sum = added((Pair){high[i], low[i]}, (Pair){change[i], 0.0});
        high[i] = sum.high, low[i] = sum.low;
    }
}
