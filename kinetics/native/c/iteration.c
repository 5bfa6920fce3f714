/* Incomplete factors of a chain's equations, and the Krylov method that they precondition: what incomplete.py and
 * krylov.py do, to the last bit. Rates are rows of a compressed table, in each rising columns without the diagonal. */

#include <math.h>
#include <stdint.h>

/* Factors: shares of what is reduced, below and above the diagonal, which lies before middles[i]; and the equations. */
typedef struct {
    const int32_t *begins, *middles, *columns;
    const double *shares, *reduced, *rates, *exits;
    int64_t n;
} Factored;

/* Take out the states from the first to the last (Meijerink & van der Vorst 1977). places (n) : room */
void reduce_incomplete(const int32_t *begins, const int32_t *columns, double *shares, double *leaving, int32_t *middles,
                       double *exits, int64_t n, int32_t *places)
{
    for (int64_t i = 0; i < n; i++)
        places[i] = -1;
    for (int64_t i = 0; i < n; i++) {
        const int32_t end = begins[i + 1];
        for (int32_t e = begins[i]; e < end; e++)
            places[columns[e]] = e;
        double lost = leaving[i];
        int32_t e = begins[i];
        for (; e < end && columns[e] < i; e++) {
            const int32_t k = columns[e];
            const double share = shares[e] / exits[k];
            shares[e] = share;
            lost += share * leaving[k];
            /* what went through state k is rerouted; without an entry for the pair, it leaves the chain */
            for (int32_t f = middles[k]; f < begins[k + 1]; f++) {
                const int32_t j = columns[f];
                if (j == i)
                    continue;
                if (places[j] >= 0)
                    shares[places[j]] += share * shares[f];
                else
                    lost += share * shares[f];
            }
        }
        middles[i] = e;
        leaving[i] = lost;
        for (int32_t f = e; f < end; f++)
            lost += shares[f];
        exits[i] = lost;
        for (int32_t f = begins[i]; f < end; f++)
            places[columns[f]] = -1;
    }
}

/* Reward accumulated until exit in the chain of the factors, at reward rates x: forward with the shares below the
 * diagonal, then backward with the rates above it. */
void sweep_solve(const Factored *a, double *x)
{
    for (int64_t i = 0; i < a->n; i++) {
        double total = x[i];
        for (int32_t e = a->begins[i]; e < a->middles[i]; e++)
            total += a->shares[e] * x[a->columns[e]];
        x[i] = total;
    }
    for (int64_t i = a->n - 1; i >= 0; i--) {
        double total = x[i];
        for (int32_t e = a->middles[i]; e < a->begins[i + 1]; e++)
            total += a->shares[e] * x[a->columns[e]];
        x[i] = total / a->reduced[i];
    }
}

/* Expected time in each state of the chain of the factors, from a start x. */
void sweep_occupy(const Factored *a, double *x)
{
    for (int64_t i = 0; i < a->n; i++) {
        const double here = x[i] / a->reduced[i];
        x[i] = here;
        if (here != 0.0)
            for (int32_t e = a->middles[i]; e < a->begins[i + 1]; e++)
                x[a->columns[e]] += here * a->shares[e];
    }
    for (int64_t i = a->n - 1; i >= 0; i--) {
        const double here = x[i];
        if (here != 0.0)
            for (int32_t e = a->begins[i]; e < a->middles[i]; e++)
                x[a->columns[e]] += here * a->shares[e];
    }
}

/* A x. */
void multiply_accumulated(const Factored *a, const double *x, double *result)
{
    for (int64_t i = 0; i < a->n; i++) {
        double total = 0.0;
        for (int32_t e = a->begins[i]; e < a->begins[i + 1]; e++)
            total += a->rates[e] * x[a->columns[e]];
        result[i] = a->exits[i] * x[i] - total;
    }
}

/* x A. */
void multiply_occupied(const Factored *a, const double *x, double *result)
{
    for (int64_t i = 0; i < a->n; i++)
        result[i] = a->exits[i] * x[i];
    for (int64_t i = 0; i < a->n; i++)
        for (int32_t e = a->begins[i]; e < a->begins[i + 1]; e++)
            result[a->columns[e]] -= a->rates[e] * x[i];
}

/* out = K^-1 (values in units), product = out A or A out, in those units. */
static void preconditioned(const Factored *a, int64_t is_occupation, const double *values, const double *units,
                           const double *shrinks, double *out, double *product)
{
    for (int64_t i = 0; i < a->n; i++)
        out[i] = values[i] * units[i];
    if (is_occupation) {
        sweep_occupy(a, out);
        multiply_occupied(a, out, product);
    } else {
        sweep_solve(a, out);
        multiply_accumulated(a, out, product);
    }
    for (int64_t i = 0; i < a->n; i++)
        product[i] *= shrinks[i];
}

static double inner(const double *a, const double *b, int64_t n)
{
    double total = 0.0;
    for (int64_t i = 0; i < n; i++)
        total += a[i] * b[i];
    return total;
}

/* BiCGSTAB (van der Vorst 1992), rounds `done` to `most`: the names of the paper are left = r, first = r_0 hat, step =
 * p, far = K^-1 p, moved = v, near = K^-1 s, bent = t. memory (4, n), numbers (3) go from call to call; room (3, n).
 * *is_over: no more rounds are needed. Returns the rounds done. */
int64_t correct_residuals(const Factored *a, int64_t is_occupation, const double *units, double *left, double *change,
                          const double *goal, double *memory, double *numbers, double *room, int64_t done, int64_t most,
                          int64_t *is_over)
{
    const int64_t n = a->n;
    double *first = memory, *step = first + n, *moved = step + n, *bent = moved + n;
    double *far = room, *near = far + n, *shrinks = near + n;
    for (int64_t i = 0; i < n; i++)
        shrinks[i] = 1.0 / units[i];
    if (done == 0) {
        for (int64_t i = 0; i < n; i++) {
            left[i] *= shrinks[i];
            first[i] = left[i];
            step[i] = moved[i] = 0.0;
        }
        numbers[0] = numbers[1] = numbers[2] = 1.0;
    }
    double before = numbers[0], alpha = numbers[1], omega = numbers[2];
    *is_over = 1;
    for (int64_t k = done; k < most; k++) {
        /* beta = (rho_k / rho_(k-1)) (alpha / omega), p = r + beta (p - omega v) */
        double product = inner(first, left, n);
        const double beta = k ? (product / before) * (alpha / omega) : 0.0;
        before = product;
        for (int64_t i = 0; i < n; i++)
            step[i] = left[i] + beta * (step[i] - omega * moved[i]);
        preconditioned(a, is_occupation, step, units, shrinks, far, moved);
        /* alpha = rho / (r_0 hat, v); not finite or 0 is a breakdown, which keeps the correction so far */
        alpha = before / inner(first, moved, n);
        if (!isfinite(alpha) || alpha == 0.0)
            return k;
        for (int64_t i = 0; i < n; i++) /* s = r - alpha v */
            left[i] -= alpha * moved[i];
        preconditioned(a, is_occupation, left, units, shrinks, near, bent);
        /* omega = (t, s) / (t, t), the length that makes the residual smallest */
        const double square = inner(bent, bent, n);
        omega = square > 0.0 ? inner(bent, left, n) / square : 0.0;
        /* x += alpha K^-1 p + omega K^-1 s, r = s - omega t */
        double largest = 0.0;
        for (int64_t i = 0; i < n; i++) {
            change[i] += alpha * far[i] + omega * near[i];
            left[i] -= omega * bent[i];
            if (fabs(left[i]) > largest)
                largest = fabs(left[i]);
        }
        if (largest <= *goal || omega == 0.0 || !isfinite(largest))
            return k + 1;
    }
    numbers[0] = before, numbers[1] = alpha, numbers[2] = omega;
    *is_over = 0;
    return most;
}
