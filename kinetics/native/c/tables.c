/* Square sparse tables by rows, and which of their states lead to each other. */

#include <stdint.h>
#include <string.h>

/* Put entries (row, column, value) in order of their rows, then columns, and add up those of one place in the order in
 * which they came. Two stable sorts by counting, the first by columns: linear in entries and n. Returns how many places
 * are left. begins (n + 1), columns and values (n_entries) come out; room (n_entries + n + 1). */
int64_t rows_of(const int64_t *row_of, const int64_t *column_of, const double *value_of, int64_t n_entries, int64_t n,
                int64_t *begins, int64_t *columns, double *values, int64_t *room)
{
    int64_t *by_column = room, *next = room + n_entries;
    memset(next, 0, (size_t)(n + 1) * sizeof *next);
    for (int64_t k = 0; k < n_entries; k++)
        next[column_of[k] + 1]++;
    for (int64_t j = 0; j < n; j++)
        next[j + 1] += next[j];
    for (int64_t k = 0; k < n_entries; k++)
        by_column[next[column_of[k]]++] = k;
    memset(begins, 0, (size_t)(n + 1) * sizeof *begins);
    for (int64_t k = 0; k < n_entries; k++)
        begins[row_of[k] + 1]++;
    for (int64_t i = 0; i < n; i++)
        begins[i + 1] += begins[i];
    memcpy(next, begins, (size_t)(n + 1) * sizeof *next);
    for (int64_t at = 0; at < n_entries; at++) {
        const int64_t k = by_column[at], to = next[row_of[k]]++;
        columns[to] = column_of[k];
        values[to] = value_of[k];
    }
    int64_t kept = 0, begin = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t first = kept, end = begins[i + 1];
        for (int64_t k = begin; k < end; k++) {
            if (kept > first && columns[kept - 1] == columns[k]) {
                values[kept - 1] += values[k];
                continue;
            }
            columns[kept] = columns[k];
            values[kept++] = values[k];
        }
        begin = end;
        begins[i + 1] = kept;
    }
    return kept;
}

/* Number (n) of the class of states that lead to each other and back, classes in the order of their first states;
 * returns how many there are. Tarjan (1972), doi:10.1137/0201010, without recursion. room (5 n).
 * A way goes from i to ends[begins[i]], ..., ends[begins[i + 1] - 1]. */
int64_t components(const int64_t *begins, const int64_t *ends, int64_t n, int64_t *label, int64_t *room)
{
    int64_t *found = room, *lowest = room + n, *open = room + 2 * n, *path = room + 3 * n, *next = room + 4 * n;
    int64_t n_found = 0, n_open = 0, n_classes = 0;
    for (int64_t i = 0; i < n; i++)
        found[i] = label[i] = -1;
    for (int64_t start = 0; start < n; start++) {
        if (found[start] >= 0)
            continue;
        int64_t depth = 0;
        path[0] = start;
        while (depth >= 0) {
            const int64_t i = path[depth];
            if (found[i] < 0) {
                found[i] = lowest[i] = n_found++;
                next[i] = begins[i];
                open[n_open++] = i;
            }
            int64_t into = -1;
            while (next[i] < begins[i + 1] && into < 0) {
                const int64_t j = ends[next[i]++];
                if (found[j] < 0)
                    into = j;
                else if (label[j] < 0 && found[j] < lowest[i])
                    lowest[i] = found[j];
            }
            if (into >= 0) {
                path[++depth] = into;
                continue;
            }
            if (lowest[i] == found[i]) { /* the first of its class: all that are open behind it */
                int64_t j;
                do {
                    j = open[--n_open];
                    label[j] = n_classes;
                } while (j != i);
                n_classes++;
            }
            depth--;
            if (depth >= 0 && lowest[i] < lowest[path[depth]])
                lowest[path[depth]] = lowest[i];
        }
    }
    for (int64_t c = 0; c < n_classes; c++)
        room[c] = -1;
    int64_t n_named = 0;
    for (int64_t i = 0; i < n; i++) {
        if (room[label[i]] < 0)
            room[label[i]] = n_named++;
        label[i] = room[label[i]];
    }
    return n_classes;
}
