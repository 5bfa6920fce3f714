/* State reduction on a banded chain without subtractions (Grassmann, Taksar & Heyman 1985): what elimination.py does,
 * to the last bit. band (n, 2b + 1); 0 comes back where an exit rate is 0 by which something is divided. */

#include <stdint.h>

#define AT(i, j) band[(i) * (2 * b + 1) + (j) - (i) + b]

/* For k = end - 1, ..., begin: S_k = l_k + sum over j < k of q_kj, then for i, j < k q_ij += (q_ik / S_k) q_kj and
 * l_i += (q_ik / S_k) l_k. */
int64_t reduce_band(double *band, double *leaving, double *exits, int64_t begin, int64_t end, int64_t b)
{
    int64_t changes = 0;
    for (int64_t k = end - 1; k >= begin; k--) {
        const int64_t low = k > b ? k - b : 0;
        double total = leaving[k], rest = 0.0; /* what the additions round off: Knuth's two-sum */
        for (int64_t j = low; j < k; j++) {
            const double rate = AT(k, j), larger = total + rate, part = larger - total;
            rest += (total - (larger - part)) + (rate - part);
            total = larger;
        }
        total += rest;
        exits[k] = total;
        if (total == 0.0)
            continue;
        for (int64_t i = low; i < k; i++) {
            if (AT(i, k) == 0.0)
                continue;
            const double share = AT(i, k) / total;
            AT(i, k) = share;
            changes++;
            leaving[i] += share * leaving[k];
            for (int64_t j = low; j < k; j++)
                AT(i, j) += share * AT(k, j);
        }
    }
    return changes;
}

/* Reward accumulated until exit at reward rates x: for falling k, x_i += (q_ik / S_k) x_k; then for rising k,
 * x_k = (x_k + sum over j < k of q_kj x_j) / S_k. */
int solve_band(const double *band, const double *exits, double *x, int64_t n, int64_t b)
{
    for (int64_t k = n - 1; k > 0; k--)
        if (x[k] != 0.0)
            for (int64_t i = k > b ? k - b : 0; i < k; i++)
                x[i] += AT(i, k) * x[k];
    for (int64_t k = 0; k < n; k++) {
        double total = x[k];
        for (int64_t j = k > b ? k - b : 0; j < k; j++)
            total += AT(k, j) * x[j];
        if (exits[k] == 0.0)
            return 0;
        x[k] = total / exits[k];
    }
    return 1;
}

/* Expected time in each state from a start spread as x: for falling k, x_k /= S_k and x_j += x_k q_kj; then for
 * rising k, x_k += sum over i < k of x_i q_ik / S_k. */
int occupy_band(const double *band, const double *exits, double *x, int64_t n, int64_t b)
{
    for (int64_t k = n - 1; k >= 0; k--) {
        if (exits[k] == 0.0)
            return 0;
        x[k] /= exits[k];
        if (x[k] != 0.0)
            for (int64_t j = k > b ? k - b : 0; j < k; j++)
                x[j] += AT(k, j) * x[k];
    }
    for (int64_t k = 1; k < n; k++)
        for (int64_t i = k > b ? k - b : 0; i < k; i++)
            x[k] += x[i] * AT(i, k);
    return 1;
}
