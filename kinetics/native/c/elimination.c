/* State reduction on a banded chain without subtractions (Grassmann, Taksar & Heyman 1985): what elimination.py does,
 * to the last bit. band (n, 2b + 1); 0 comes back where an exit rate is 0 by which something is divided. */

#include <math.h>
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

/* Stationary weights of a chain that nothing leaves, up to a factor: x_0 = 1, x_k = sum over i < k of x_i q_ik / S_k. */
void balance_band(const double *band, double *x, int64_t n, int64_t b)
{
    x[0] = 1.0;
    for (int64_t k = 1; k < n; k++) {
        double total = 0.0;
        for (int64_t i = k > b ? k - b : 0; i < k; i++)
            total += x[i] * AT(i, k);
        x[k] = total;
        if (total > 1e200) /* only ratios count, and weights may grow beyond double */
            for (int64_t i = 0; i <= k; i++)
                x[i] *= 1e-200;
    }
}

/* Logarithms of probabilities that balance each state with the one that a search in width finds it from: balance.py says
 * how. found, queue: room for n each. */
void balanced(const int64_t *begins, const int64_t *columns, const double *rates, const double *exits, double *logs,
              char *found, int64_t *queue, int64_t n)
{
    int64_t end = 1;
    found[0] = 1, queue[0] = 0, logs[0] = 0.0;
    for (int64_t at = 0; at < end; at++) {
        const int64_t i = queue[at];
        for (int64_t e = begins[i]; e < begins[i + 1]; e++) {
            const int64_t j = columns[e];
            if (found[j])
                continue;
            double back = exits[j];
            for (int64_t f = begins[j]; f < begins[j + 1]; f++)
                if (columns[f] == i)
                    back = rates[f];
            logs[j] = logs[i] + log(rates[e]) - log(back);
            found[j] = 1;
            queue[end++] = j;
        }
    }
}
