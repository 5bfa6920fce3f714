/* The states of a network in a hash table, and steps of its Markov chain: what exploration.py and markov.py do. */

#include "streams.h"

#define EMPTY (-1)
#define OUTSIDE (-2)

enum { COMPLETE = 0, TOO_MANY = 1, UNJUDGED = 2, TOO_LARGE = 3, FULL = -1 }; /* as in exploration.py; FULL: no more room */

/* Rows of a sparse table: entries starts[r] to starts[r + 1], each a species and its copies. */
typedef struct {
    const int64_t *starts, *species, *copies;
} SparseRows;

/* States, their keys, and a hash table of the rows by their keys. */
typedef struct {
    int64_t *states; /* (room, n_species) */
    uint64_t *keys;
    int64_t *slots; /* a power of two of them */
    int64_t room, n_slots, n_species;
} HashedStates;

/* What is known of some states: whether the chain stops there, and which of the channels with a law work. */
typedef struct {
    const char *stops, *works; /* a row of n_laws for each state */
    const int64_t *law_of; /* number of each channel's law; -1 for mass action */
    int64_t n_laws;
} StateVerdicts;

/* Where an exploration stands, so that it can go on. */
typedef struct {
    int64_t i, n, n_levels, level_end;
} SearchProgress;

/* The moves into each of n states: their sources and shares from begins[i] to begins[i + 1]. */
typedef struct {
    const uint32_t *begins, *sources;
    const double *shares, *exits;
    int64_t n;
} ChainMoves;

/* Where the search for a key begins: its bits mixed, modulo a power of two. Collisions go on to the next slot. */
INLINE int64_t first_slot(uint64_t key, int64_t n_slots)
{
    const uint64_t mixed = (key ^ (key >> 29)) * 0x9E3779B97F4A7C15u;
    return (int64_t)((mixed ^ (mixed >> 32)) & (uint64_t)(n_slots - 1));
}

/* Enter a row under its key into the first free slot. */
INLINE void put(uint64_t key, int64_t row, int64_t *slots, int64_t n_slots)
{
    int64_t slot = first_slot(key, n_slots);
    while (slots[slot] != EMPTY)
        slot = (slot + 1) & (n_slots - 1);
    slots[slot] = row;
}

/* Make the hash table anew from the keys of n rows. */
void tabulate(const uint64_t *keys, int64_t n, int64_t *slots, int64_t n_slots)
{
    for (int64_t i = 0; i < n_slots; i++)
        slots[i] = EMPTY;
    for (int64_t i = 0; i < n; i++)
        put(keys[i], i, slots, n_slots);
}

/* The row of a state with this key; EMPTY where it is not in the table. */
INLINE int64_t row_of(const HashedStates *space, const int64_t *state, uint64_t key)
{
    const size_t width = (size_t)space->n_species * sizeof *state;
    const int64_t n_slots = space->n_slots;
    for (int64_t slot = first_slot(key, n_slots); space->slots[slot] != EMPTY; slot = (slot + 1) & (n_slots - 1)) {
        const int64_t row = space->slots[slot];
        if (space->keys[row] == key && !memcmp(space->states + row * space->n_species, state, width))
            return row;
    }
    return EMPTY;
}

/* The rows of states asked for; EMPTY for those not in the table. */
void find(const int64_t *asked, const uint64_t *asked_keys, int64_t n, const HashedStates *space, int64_t *rows)
{
    for (int64_t i = 0; i < n; i++)
        rows[i] = row_of(space, asked + i * space->n_species, asked_keys[i]);
}

/* Add those of m states that are new, for all of which there is room; returns how many there are then. */
int64_t insert(const int64_t *states, const uint64_t *keys, int64_t m, const HashedStates *space, int64_t n, int64_t *rows)
{
    const size_t width = (size_t)space->n_species * sizeof *states;
    for (int64_t i = 0; i < m; i++) {
        const int64_t *state = states + i * space->n_species;
        rows[i] = row_of(space, state, keys[i]);
        if (rows[i] != EMPTY)
            continue;
        memcpy(space->states + n * space->n_species, state, width);
        space->keys[n] = keys[i];
        put(keys[i], n, space->slots, space->n_slots);
        rows[i] = n++;
    }
    return n;
}

/* Whether state i becomes state `row` by the changes of channel r, whose species rise in number. */
INLINE int leads_to(const HashedStates *space, int64_t i, int64_t row, const SparseRows *changes, int64_t r)
{
    const int64_t *from = space->states + i * space->n_species, *to = space->states + row * space->n_species;
    const int64_t last = changes->starts[r + 1];
    int64_t e = changes->starts[r];
    for (int64_t s = 0; s < space->n_species; s++) {
        uint64_t count = (uint64_t)from[s];
        if (e < last && changes->species[e] == s)
            count += (uint64_t)changes->copies[e++];
        if ((uint64_t)to[s] != count)
            return 0;
    }
    return 1;
}

/* The row of state i after channel r, which has this key; OUTSIDE where it is not in the table. */
INLINE int64_t neighbour(const HashedStates *space, int64_t i, uint64_t key, const SparseRows *changes, int64_t r)
{
    const int64_t n_slots = space->n_slots;
    for (int64_t slot = first_slot(key, n_slots); space->slots[slot] != EMPTY; slot = (slot + 1) & (n_slots - 1)) {
        const int64_t row = space->slots[slot];
        if (space->keys[row] == key && leads_to(space, i, row, changes, r))
            return row;
    }
    return OUTSIDE;
}

/* Put state i after channel r into the next row, or say why not. */
INLINE int add_state(const HashedStates *space, int64_t i, uint64_t key, const SparseRows *changes, int64_t r, int64_t most,
                     int64_t *n)
{
    int64_t *state = space->states + *n * space->n_species;
    int outcome = COMPLETE;
    if (*n >= most)
        return TOO_MANY;
    if (*n == space->room)
        return FULL;
    memcpy(state, space->states + i * space->n_species, (size_t)space->n_species * sizeof *state);
    for (int64_t e = changes->starts[r]; e < changes->starts[r + 1]; e++) {
        int64_t *count = state + changes->species[e];
        *count = (int64_t)((uint64_t)*count + (uint64_t)changes->copies[e]);
        if (*count < 0)
            outcome = TOO_LARGE;
    }
    if (outcome == COMPLETE) {
        space->keys[*n] = key;
        put(key, *n, space->slots, space->n_slots);
        ++*n;
    }
    return outcome;
}

/* Whether channel r can fire in state i under mass action. */
INLINE int has_reactants(const HashedStates *space, int64_t i, const SparseRows *needed, int64_t r)
{
    int is_able = 1;
    for (int64_t e = needed->starts[r]; e < needed->starts[r + 1]; e++)
        is_able &= space->states[i * space->n_species + needed->species[e]] >= needed->copies[e];
    return is_able;
}

/* Breadth-first search: fire every possible channel from state p->i on, and append the states that are new. A level is
 * the states that one more event leads to. Returns at UNJUDGED when a state's laws must be evaluated first. */
int explore(const SparseRows *needed, const SparseRows *changes, const uint64_t *key_changes, int64_t n_channels,
            const HashedStates *space, int64_t end, const char *is_stopped, int64_t n_stopped, const HashedStates *judged,
            const StateVerdicts *verdicts, int64_t most, int64_t *sizes, int64_t most_levels, SearchProgress *p)
{
    for (; p->i < p->n && p->i < end; p->i++) {
        const char *works = 0; /* of the channels with a law */
        if (p->i == p->level_end) {
            if (p->n_levels == most_levels)
                return FULL;
            sizes[p->n_levels++] = p->n - p->level_end;
            p->level_end = p->n;
        }
        if (p->i < n_stopped && is_stopped[p->i])
            continue;
        if (judged->n_slots) {
            const int64_t row = row_of(judged, space->states + p->i * space->n_species, space->keys[p->i]);
            if (row == EMPTY)
                return UNJUDGED;
            if (verdicts->stops[row])
                continue;
            works = verdicts->works + row * verdicts->n_laws;
        }
        for (int64_t r = 0; r < n_channels; r++) {
            const int has_law = works && verdicts->law_of[r] >= 0;
            const uint64_t key = space->keys[p->i] + key_changes[r];
            if (!(has_law ? works[verdicts->law_of[r]] : has_reactants(space, p->i, needed, r)) ||
                neighbour(space, p->i, key, changes, r) != OUTSIDE)
                continue;
            const int outcome = add_state(space, p->i, key, changes, r, most, &p->n);
            if (outcome != COMPLETE)
                return outcome;
        }
    }
    return COMPLETE;
}

/* For n states from `begin` on, the row that each channel leads to; EMPTY if its propensity is 0. */
void neighbours(int64_t begin, const double *propensities, int64_t n, int64_t n_channels, const SparseRows *changes,
                const uint64_t *key_changes, const HashedStates *space, int64_t *ends)
{
    for (int64_t i = 0; i < n; i++)
        for (int64_t r = 0; r < n_channels; r++) {
            const uint64_t key = space->keys[begin + i] + key_changes[r];
            const int64_t place = i * n_channels + r;
            ends[place] = propensities[place] == 0.0 ? EMPTY : neighbour(space, begin + i, key, changes, r);
        }
}

/* One step from `now` to `after`; the mass that left its state. */
INLINE double one_step(const ChainMoves *steps, const double *now, double *after)
{
    double flow = 0.0;
    uint32_t end = steps->begins[0];
    for (int64_t i = 0; i < steps->n; i++) {
        double inflow = 0.0;
        const uint32_t begin = end;
        end = steps->begins[i + 1];
        for (uint32_t k = begin; k < end; k++)
            inflow += steps->shares[k] * now[steps->sources[k]];
        const double outflow = steps->exits[i] * now[i];
        flow += outflow;
        /* Never negative: a rounded product with exits <= 1 is no larger than the probability itself. */
        after[i] = now[i] + (inflow - outflow);
    }
    return flow;
}

/* Uniformisation: fill the vectors after the first, each p P of the one before. */
void advance(const ChainMoves *steps, double *vectors, double *flows, int64_t n_steps)
{
    for (int64_t b = 0; b < n_steps; b++)
        flows[b] = one_step(steps, vectors + b * steps->n, vectors + (b + 1) * steps->n);
}

/* Steps on a chain whose last state is never left; before each, note its mass and that of all others. */
void absorb(const ChainMoves *steps, double *vector, double *other, double *absorbed, double *alive, double *flows, int64_t n_steps)
{
    double *now = vector, *after = other;
    for (int64_t b = 0; b < n_steps; b++) {
        double rest = 0.0;
        for (int64_t i = 0; i < steps->n - 1; i++)
            rest += now[i];
        absorbed[b] = now[steps->n - 1];
        alive[b] = rest;
        flows[b] = one_step(steps, now, after);
        double *swapped = now;
        now = after, after = swapped;
    }
    if (now != vector)
        memcpy(vector, now, (size_t)steps->n * sizeof *vector);
}

/* Steps backwards, v <- P v, P's diagonal in the place of exits; before each step its mean over the start. */
void retreat(const ChainMoves *steps, const int64_t *starts, const double *chances, int64_t n_starts, double *vector,
             double *other, double *means, int64_t n_steps)
{
    double *now = vector, *before = other;
    for (int64_t b = 0; b < n_steps; b++) {
        double mean = 0.0;
        for (int64_t m = 0; m < n_starts; m++)
            mean += chances[m] * now[starts[m]];
        means[b] = mean;
        double *swapped = now;
        now = before, before = swapped;
        uint32_t end = steps->begins[0];
        for (int64_t i = 0; i < steps->n; i++) {
            double value = steps->exits[i] * before[i];
            const uint32_t begin = end;
            end = steps->begins[i + 1];
            for (uint32_t k = begin; k < end; k++)
                value += steps->shares[k] * before[steps->sources[k]];
            now[i] = value;
        }
    }
    if (now != vector)
        for (int64_t i = 0; i < steps->n; i++) {
            const double value = vector[i];
            vector[i] = other[i], other[i] = value;
        }
}

/* The vectors after the first, each one step after the one before, p <- p P, P's diagonal in the place of exits. */
void powers(const ChainMoves *steps, double *vectors, int64_t n_steps)
{
    for (int64_t b = 0; b < n_steps; b++) {
        const double *restrict now = vectors + b * steps->n;
        double *restrict after = vectors + (b + 1) * steps->n;
        uint32_t end = steps->begins[0];
        for (int64_t i = 0; i < steps->n; i++) {
            double total = steps->exits[i] * now[i];
            const uint32_t begin = end;
            end = steps->begins[i + 1];
            for (uint32_t k = begin; k < end; k++)
                total += steps->shares[k] * now[steps->sources[k]];
            after[i] = total;
        }
    }
}

/* Steps backwards, later <- P later + weights[b] values for falling b, P's diagonal in the place of exits; note before each
 * what every move and state brings, and how often: markov.steps_back says how. */
void steps_back(const ChainMoves *steps, const double *vectors, const double *weights, const double *rests,
                const double *values, double *later, double *other, double *gained, double *held, double *mixed,
                int64_t n_steps)
{
    double *now = later, *before = other;
    for (int64_t b = n_steps - 1; b >= 0; b--) {
        const double *chances = vectors + b * steps->n, weight = weights[b], rest = rests[b];
        uint32_t end = steps->begins[0];
        for (int64_t i = 0; i < steps->n; i++) {
            const double here = now[i], chance = chances[i];
            double total = steps->exits[i] * here;
            const uint32_t begin = end;
            end = steps->begins[i + 1];
            for (uint32_t k = begin; k < end; k++) {
                const double there = now[steps->sources[k]];
                total += steps->shares[k] * there;
                gained[k] += chance * (there - here);
            }
            held[i] += chance * here;
            mixed[i] += rest * chance;
            before[i] = total + weight * values[i];
        }
        double *swapped = now;
        now = before, before = swapped;
    }
    if (now != later)
        memcpy(later, now, (size_t)steps->n * sizeof *later);
}

/* A matrix whose diagonal is `stays`. In rows firsts[r] to firsts[r + 1] the other entries are in the same places next to
 * the diagonal, offsets[entries[r]] to offsets[entries[r + 1]]; of these rows, all shares at the first of the places come
 * first, from shares[begins[r]] on. The piece p of ROWS rows begins in run pieces[p]. */
typedef struct {
    const int64_t *firsts, *entries, *offsets, *begins, *pieces;
    const double *shares, *stays;
    int64_t n_runs, n, reach, is_downwards; /* no offset is larger than `reach`, or downwards, smaller than -reach */
} RunMoves;

enum { ROWS = 256 };

/* A piece of one step, after = M now. Each entry is added to all rows of a run, so that they are side by side. */
CLONES static void one_piece(const RunMoves *m, int64_t piece, const double *restrict now, double *restrict after)
{
    const int64_t from = piece * ROWS, to = from + ROWS < m->n ? from + ROWS : m->n;
    const double *restrict stays = m->stays;
    for (int64_t i = from; i < to; i++)
        after[i] = stays[i] * now[i];
    for (int64_t r = m->pieces[piece]; r < m->n_runs && m->firsts[r] < to; r++) {
        const int64_t first = m->firsts[r], length = m->firsts[r + 1] - first;
        const int64_t begin = first > from ? first : from, end = first + length < to ? first + length : to;
        const double *share = m->shares + m->begins[r] + (begin - first);
        for (int64_t e = m->entries[r]; e < m->entries[r + 1]; e++, share += length) {
            const double *restrict there = now + begin + m->offsets[e];
            double *restrict here = after + begin;
            for (int64_t j = 0; j < end - begin; j++)
                here[j] += share[j] * there[j];
        }
    }
}

/* sum += weight now over a piece. */
CLONES static void add_piece(int64_t n, int64_t piece, double weight, const double *restrict now, double *restrict sum)
{
    const int64_t from = piece * ROWS, to = from + ROWS < n ? from + ROWS : n;
    for (int64_t i = from; i < to; i++)
        sum[i] += weight * now[i];
}

/* Steps v <- M v; before each, sums[t] += weights[t, b] v. The first of n_kept + 1 vectors is v. A row needs none that is
 * farther ahead than `reach`: a step can follow the one before at that distance, while what that wrote is still in the
 * cache. So n_kept steps go over the rows together. */
void summed_steps(const RunMoves *m, const double *weights, int64_t n_sums, int64_t n_steps, int64_t n_kept, double *vectors,
                  double *sums)
{
    const int64_t n = m->n, n_pieces = (n + ROWS - 1) / ROWS, lag = (m->reach + ROWS - 1) / ROWS + 1;
    for (int64_t b = 0; b < n_steps; b += n_kept) {
        const int64_t together = n_steps - b < n_kept ? n_steps - b : n_kept;
        for (int64_t front = 0; front < n_pieces + (together - 1) * lag; front++)
            for (int64_t s = 0; s < together; s++) {
                const int64_t place = front - s * lag, piece = m->is_downwards ? n_pieces - 1 - place : place;
                const double *now = vectors + s * n;
                if (place < 0 || place >= n_pieces)
                    continue;
                one_piece(m, piece, now, vectors + (s + 1) * n);
                for (int64_t t = 0; t < n_sums; t++)
                    if (weights[t * n_steps + b + s] != 0.0)
                        add_piece(n, piece, weights[t * n_steps + b + s], now, sums + t * n);
            }
        memcpy(vectors, vectors + together * n, (size_t)n * sizeof *vectors);
    }
}

/* mixed[rows[a]] += sum over b of weights[a, b] vectors[b], the Poisson mixture, in tiles that stay in the cache. */
CLONES void mix(const int64_t *rows, const double *weights, int64_t n_rows, int64_t n_steps, const double *vectors,
                int64_t n, double *mixed)
{
    enum { TILE = 64 };
    double total[TILE];
    for (int64_t left = 0; left < n; left += TILE) {
        const int64_t width = n - left < TILE ? n - left : TILE;
        for (int64_t a = 0; a < n_rows; a++) {
            for (int64_t j = 0; j < width; j++)
                total[j] = 0.0;
            for (int64_t b = 0; b < n_steps; b++) {
                const double weight = weights[a * n_steps + b], *vector = vectors + b * n + left;
                if (weight != 0.0)
                    for (int64_t j = 0; j < width; j++)
                        total[j] += weight * vector[j];
            }
            for (int64_t j = 0; j < width; j++)
                mixed[rows[a] * n + left + j] += total[j];
        }
    }
}

/* Mark all states to which some way leads from those in the queue, marked before: moves out of state i end at
 * ends[begins[i]] to ends[begins[i + 1]]. */
void reach(const int64_t *begins, const int64_t *ends, int64_t *queue, int64_t n_queued, char *is_found)
{
    while (n_queued > 0) {
        const int64_t i = queue[--n_queued];
        for (int64_t k = begins[i]; k < begins[i + 1]; k++)
            if (!is_found[ends[k]]) {
                is_found[ends[k]] = 1;
                queue[n_queued++] = ends[k];
            }
    }
}
