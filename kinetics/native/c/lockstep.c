/* The direct method for 64 runs side by side: the arithmetic of lockstep.py, to the last bit. */

#include "sampling.h"
#include "streams.h"
#include "thinning.h"

#include <math.h>
#include <stdlib.h>

#define LANES 64
#define GATHERED 8            /* up to so many species, all are updated whichever channel fired */
#define LARGEST_EXACT 0x1p52  /* lanes count in doubles */
#define LEAST_TOTAL 1e-290    /* below, a wait may itself be infinite */

typedef double Lanes[LANES];

/* Where the runs stand between calls: laid out as `lanes.FIELDS` has it, for lockstep.LockstepWork. */
typedef struct {
    const Model *model;
    Lanes *counts;   /* (S + 1 + sums,) */
    Lanes *within;   /* (G,) */
    Lanes *upto;     /* (blocks,) */
    double *change;  /* (S, G + 1); channel G changes nothing: what a lane does that has just ended its run */
    int64_t *starts, *species_of; /* of the species that each channel changes */
    Lanes total, part, target, t, upcoming;
    uint64_t words[4][LANES];
    int64_t run[LANES], seen[LANES], needed[LANES], begun[LANES], looks[LANES], still[LANES], stood[LANES];
    int64_t chosen[LANES];
    int64_t active, runs, steps; /* lanes in use, runs begun, events of each lane since the first call */
} Work;

INLINE void sum_terms(Work *work, int64_t active)
{
    const Model *model = work->model;
    double *part = work->part;
    for (int64_t lane = 0; lane < active; lane++)
        part[lane] = 0.0;
    for (int64_t k = 0; k < model->n_terms; k++) {
        const double *term = model->terms + 4 * k;
        const double weight = term[0], taken = term[2];
        const double *copies = work->counts[(int64_t)term[1]];
        for (int64_t lane = 0; lane < active; lane++)
            part[lane] += weight * (copies[lane] - taken);
        if (term[3] > 0.0) {
            double *sum = work->counts[(int64_t)term[3]];
            for (int64_t lane = 0; lane < active; lane++) {
                sum[lane] = part[lane];
                part[lane] = 0.0;
            }
        }
    }
}

INLINE void general(const Model *model, int64_t r, Lanes *counts, double *product, int64_t active)
{
    for (int64_t lane = 0; lane < active; lane++)
        product[lane] = model->coefficients[r];
    for (int64_t j = 0; j < model->most_factors; j++) {
        const int64_t *factor = model->factors + 3 * (r * model->most_factors + j);
        for (int64_t lane = 0; lane < active; lane++) {
            const double copies = counts[factor[0]][lane];
            product[lane] *= copies >= (double)factor[2] ? copies - (double)factor[1] : 0.0;
        }
    }
}

INLINE void sum_propensities(Work *work, int64_t active)
{
    const Model *model = work->model;
    double *part = work->part, *total = work->total;
    for (int64_t lane = 0; lane < active; lane++)
        total[lane] = 0.0;
    for (int64_t block = 0; block < model->n_blocks; block++) {
        const int64_t end = BLOCK * (block + 1) < model->n_channels ? BLOCK * (block + 1) : model->n_channels;
        for (int64_t lane = 0; lane < active; lane++)
            part[lane] = 0.0;
        for (int64_t r = BLOCK * block; r < end; r++) {
            double *within = work->within[r];
            if (model->is_general[r]) {
                general(model, r, work->counts, work->target, active);
                for (int64_t lane = 0; lane < active; lane++) {
                    part[lane] += work->target[lane];
                    within[lane] = part[lane];
                }
            } else {
                const double coefficient = model->coefficients[r], less = model->less[r];
                const double *first = work->counts[model->first[r]], *second = work->counts[model->second[r]];
                for (int64_t lane = 0; lane < active; lane++) {
                    part[lane] += coefficient * first[lane] * (second[lane] - less);
                    within[lane] = part[lane];
                }
            }
        }
        for (int64_t lane = 0; lane < active; lane++) {
            total[lane] += part[lane];
            work->upto[block][lane] = total[lane];
        }
    }
}

/* Candidates besides the events, in a crowd. */
INLINE void add_candidates(Work *work, int64_t active)
{
    const Thinning *thinning = work->model->thinning;
    const int64_t last = thinning->first - 1; /* of the channels that the crowd does not change */
    const double ratio = thinning->ratio;
    double *before = work->part, *total = work->total;
    if (last >= 0 && last < BLOCK)
        before = work->within[last];
    else
        for (int64_t lane = 0; lane < active; lane++)
            before[lane] = last < 0 ? 0.0 : work->within[last][lane] + work->upto[last / BLOCK - 1][lane];
    for (int64_t lane = 0; lane < active; lane++)
        total[lane] += ratio * (total[lane] - before[lane]);
}

/* Draw the time of the next event of each lane, and where in the total it falls; how many pass a time of the grid.
 * `part` keeps the times before. */
INLINE int64_t move_clocks(Work *work, int64_t active)
{
    uint64_t(*words)[LANES] = work->words;
    int64_t n_crossed = 0;
    for (int64_t lane = 0; lane < active; lane++) {
        uint64_t s0 = words[0][lane], s1 = words[1][lane], s2 = words[2][lane], s3 = words[3][lane];
        const uint64_t first = next_word(&s0, &s1, &s2, &s3), second = next_word(&s0, &s1, &s2, &s3);
        words[0][lane] = s0, words[1][lane] = s1, words[2][lane] = s2, words[3][lane] = s3;
        work->target[lane] = uniform(second) * work->total[lane];
        double later = work->t[lane] + exponential(first) / work->total[lane];
        work->part[lane] = work->t[lane];
        later = later > work->t[lane] ? later : INFINITY; /* a clock that stands still, or a total beyond double */
        n_crossed += later > work->upcoming[lane];
        work->t[lane] = later;
    }
    return n_crossed;
}

/* Step 3 of the direct method in every lane, without branches: the channel is the number of running sums not above the
 * target. A lane without an event has an infinite target, and channel R, which changes nothing. */
INLINE void choose(Work *work, int64_t active)
{
    const Model *model = work->model;
    const double *total = work->total, *target = work->target;
    int64_t *chosen = work->chosen;
    Lanes *rows = model->n_blocks == 1 ? work->within : work->upto;
    const int64_t n_rows = model->n_blocks == 1 ? model->n_channels : model->n_blocks;
    for (int64_t lane = 0; lane < active; lane++)
        chosen[lane] = 0;
    for (int64_t row = 0; row < n_rows; row++)
        for (int64_t lane = 0; lane < active; lane++)
            chosen[lane] += (rows[row][lane] <= target[lane]) & (rows[row][lane] < total[lane]);
    if (model->n_blocks == 1)
        return;
    for (int64_t lane = 0; lane < active; lane++) {
        const int64_t block = chosen[lane];
        if (block == model->n_blocks) {
            chosen[lane] = model->n_channels;
            continue;
        }
        const double aim = target[lane] - (block > 0 ? work->upto[block - 1][lane] : 0.0);
        const int64_t begin = BLOCK * block;
        const int64_t end = begin + BLOCK < model->n_channels ? begin + BLOCK : model->n_channels;
        chosen[lane] = begin;
        for (int64_t r = begin; r < end; r++)
            chosen[lane] += (work->within[r][lane] <= aim) & (work->within[r][lane] < work->within[end - 1][lane]);
    }
}

/* Step 4: change the counts, by whole rows for few species. */
INLINE void fire(Work *work, int64_t active)
{
    const Model *model = work->model;
    const int64_t *chosen = work->chosen;
    if (model->n_species <= GATHERED) {
        for (int64_t s = 0; s < model->n_species; s++) {
            const double *change = work->change + s * (model->n_channels + 1);
            for (int64_t lane = 0; lane < active; lane++)
                work->counts[s][lane] += change[chosen[lane]];
        }
        return;
    }
    for (int64_t lane = 0; lane < active; lane++)
        for (int64_t k = work->starts[chosen[lane]]; k < work->starts[chosen[lane] + 1]; k++) {
            const int64_t s = work->species_of[k];
            work->counts[s][lane] += work->change[s * (model->n_channels + 1) + chosen[lane]];
        }
}

/* One event in every lane up to its choice; how many lanes pass a time of the grid. */
CLONES static int64_t step(Work *work, int64_t active)
{
    sum_terms(work, active);
    sum_propensities(work, active);
    return move_clocks(work, active);
}

CLONES static void finish_step(Work *work, int64_t active)
{
    choose(work, active);
    fire(work, active);
}

/* The same for a network in a crowd: `drew` are the lanes that drew a candidate, if they go on with their run. */
CLONES static int64_t step_thinned(Work *work, int64_t active)
{
    sum_terms(work, active);
    sum_propensities(work, active);
    add_candidates(work, active);
    int64_t n_odd = move_clocks(work, active);
    const double *surely = work->upto[work->model->n_blocks - 1];
    for (int64_t lane = 0; lane < active; lane++)
        n_odd += work->target[lane] >= surely[lane];
    return n_odd;
}

CLONES static void finish_step_thinned(Work *work, int64_t active, const int64_t *drew, int64_t n_drew)
{
    const double *surely = work->upto[work->model->n_blocks - 1];
    choose(work, active);
    for (int64_t i = 0; i < n_drew; i++) {
        const int64_t lane = drew[i];
        if (surely[lane] < work->total[lane] && work->target[lane] < INFINITY)
            work->chosen[lane] = kept_channel(work->model, *work->within + lane, *work->counts + lane, LANES,
                                              work->target[lane] - surely[lane]);
    }
    fire(work, active);
}

/* Take up the next run in a lane. */
static void begin_lane(Work *work, int64_t lane, const int64_t *initial, const double *grid, const uint64_t *key,
                       int64_t first_run, const int64_t *limits)
{
    const int64_t i = work->runs++;
    for (int j = 0; j < 4; j++)
        work->words[j][lane] = stream_word(key[j], first_run + i);
    for (int64_t s = 0; s < work->model->n_species; s++)
        work->counts[s][lane] = (double)initial[s];
    work->run[lane] = i, work->seen[lane] = 0, work->needed[lane] = i < limits[2] ? limits[0] : limits[1];
    work->t[lane] = 0.0, work->upcoming[lane] = work->needed[lane] > 0 ? grid[0] : -INFINITY;
    work->begun[lane] = work->steps, work->looks[lane] = work->steps + limits[3];
    work->still[lane] = 0, work->stood[lane] = -1;
}

/* Move the lanes in use together after runs have ended; returns their number. */
static int64_t closed_ranks(Work *work, int64_t active)
{
    const int64_t n_rows = work->model->n_species + 1 + work->model->n_sums;
    int64_t kept = 0;
    for (int64_t lane = 0; lane < active; lane++) {
        if (work->run[lane] < 0)
            continue;
        for (int64_t row = 0; row < n_rows; row++)
            work->counts[row][kept] = work->counts[row][lane];
        for (int j = 0; j < 4; j++)
            work->words[j][kept] = work->words[j][lane];
        work->t[kept] = work->t[lane], work->upcoming[kept] = work->upcoming[lane];
        work->run[kept] = work->run[lane], work->seen[kept] = work->seen[lane];
        work->needed[kept] = work->needed[lane], work->begun[kept] = work->begun[lane];
        work->looks[kept] = work->looks[lane];
        work->still[kept] = work->still[lane], work->stood[kept] = work->stood[lane];
        kept++;
    }
    return kept;
}

/* Whether a lane cannot go on: its clock has stalled, or its total or a count are beyond what it holds. A lane whose
 * clock stands still comes with an infinite time, and takes that before it. */
static int is_stuck(Work *work, int64_t lane)
{
    const double total = work->total[lane];
    if (work->t[lane] < INFINITY || total == 0.0 || work->seen[lane] >= work->needed[lane])
        return 0;
    work->t[lane] = work->part[lane];
    work->still[lane] = work->stood[lane] == work->steps - 1 ? work->still[lane] + 1 : 1;
    work->stood[lane] = work->steps;
    return !(total > LEAST_TOTAL && total < INFINITY) || work->still[lane] >= (int64_t)MOST_STILL;
}

/* Whether the condition holds in a lane: stopping.holds. */
static int holds(const Work *work, const Stop *stop, int64_t lane)
{
    int64_t place = 0;
    while (place >= 0) {
        const double *row = stop->table + place, *end = row + TERMS + 2 * (int64_t)row[N_TERMS];
        double total = 0.0;
        for (const double *term = row + TERMS; term < end; term += 2)
            total += term[1] * work->counts[(int64_t)term[0]][lane];
        place = (int64_t)(row[LOW] <= total && total <= row[HIGH] ? row[YES] : row[NO]);
    }
    return place == HOLDS;
}

/* Whether no run is to end, as far as a single comparison of all lanes at once shows it. */
CLONES static int none_holds(Work *work, const Stop *stop, int64_t active)
{
    const double *row = stop->table;
    if (row[YES] >= 0.0 || row[NO] >= 0.0)
        return 0;
    double *total = work->part;
    for (int64_t lane = 0; lane < active; lane++)
        total[lane] = 0.0;
    for (int64_t k = 0; k < (int64_t)row[N_TERMS]; k++) {
        const double weight = row[TERMS + 2 * k + 1], *counts = work->counts[(int64_t)row[TERMS + 2 * k]];
        for (int64_t lane = 0; lane < active; lane++)
            total[lane] += weight * counts[lane];
    }
    const double low = row[LOW], high = row[HIGH];
    int64_t n_inside = 0;
    for (int64_t lane = 0; lane < active; lane++)
        n_inside += (low <= total[lane]) & (total[lane] <= high);
    return row[YES] == HOLDS ? n_inside == 0 : n_inside == active;
}

INLINE void go_on(const Model *model, Work *work, const int64_t *initial, const double *grid, int64_t n_times,
                  const uint64_t *key, int64_t first_run, const int64_t *limits, int64_t runs, int64_t *out,
                  char *is_odd, int64_t most, const Stop *stop, double *reached, const int in_crowd)
{
    const int64_t n_species = model->n_species, last = work->steps + most;
    int64_t active = work->active;
    work->model = model;
    if (work->runs == 0)
        for (active = 0; active < LANES && active < runs; active++)
            begin_lane(work, active, initial, grid, key, first_run, limits);
    for (int64_t lane = 0; lane < active; lane++) {
        work->needed[lane] = work->run[lane] < limits[2] ? limits[0] : limits[1];
        if (work->seen[lane] >= work->needed[lane])
            work->upcoming[lane] = -INFINITY; /* its run is over */
    }
    while (active > 0 && work->steps < last) {
        int64_t drew[LANES], n_drew = 0;
        int64_t n_crossed = in_crowd ? step_thinned(work, active) : step(work, active), n_ended = 0;
        if (++work->steps % 1024 == 0) /* with changes below 2**40, no count can pass 2**53 in between */
            for (int64_t s = 0; s < n_species; s++)
                for (int64_t lane = 0; lane < active; lane++)
                    if (work->counts[s][lane] > LARGEST_EXACT) {
                        work->t[lane] = work->total[lane] = INFINITY;
                        n_crossed++;
                    }
        for (int64_t lane = 0; n_crossed > 0 && lane < active; lane++) {
            if (in_crowd && work->target[lane] >= work->upto[model->n_blocks - 1][lane])
                drew[n_drew++] = lane;
            if (!(work->t[lane] > work->upcoming[lane]))
                continue;
            const int stuck = is_stuck(work, lane);
            if (!stuck && !(work->t[lane] > work->upcoming[lane])) /* it takes the time before again */
                continue;
            int64_t k = work->seen[lane];
            for (; !stuck && k < work->needed[lane] && grid[k] < work->t[lane]; k++)
                for (int64_t s = 0; s < n_species; s++)
                    out[(work->run[lane] * n_times + k) * n_species + s] = (int64_t)work->counts[s][lane];
            work->seen[lane] = k;
            if (!stuck && k < work->needed[lane]) {
                work->upcoming[lane] = grid[k];
                continue;
            }
            if (stuck)
                is_odd[work->run[lane]] = 1;
            work->target[lane] = work->total[lane] = INFINITY;
            if (work->runs < runs) {
                begin_lane(work, lane, initial, grid, key, first_run, limits);
            } else {
                work->run[lane] = -1;
                n_ended++;
            }
        }
        if (in_crowd)
            finish_step_thinned(work, active, drew, n_drew);
        else
            finish_step(work, active);
        const int64_t n_asked = stop && !none_holds(work, stop, active) ? active : 0;
        for (int64_t lane = 0; lane < n_asked; lane++) {
            if (work->run[lane] < 0 || !stop->affects_stop[work->chosen[lane]] || !holds(work, stop, lane))
                continue;
            reached[work->run[lane]] = work->t[lane];
            for (int64_t k = work->seen[lane]; k < n_times; k++)
                for (int64_t s = 0; s < n_species; s++)
                    out[(work->run[lane] * n_times + k) * n_species + s] = (int64_t)work->counts[s][lane];
            if (work->runs < runs) {
                begin_lane(work, lane, initial, grid, key, first_run, limits);
            } else {
                work->run[lane] = -1;
                n_ended++;
            }
        }
        if (n_ended > 0)
            active = closed_ranks(work, active);
    }
    work->active = active;
}

/* `lockstep.lockstep`. The grid has n_times times. */
void lockstep(const Model *model, Work *work, const int64_t *initial, const double *grid, int64_t n_times,
              const uint64_t *key, int64_t first_run, const int64_t *limits, int64_t runs, int64_t *out, char *is_odd,
              int64_t most, const Stop *stop, double *reached)
{
    if (model->thinning)
        go_on(model, work, initial, grid, n_times, key, first_run, limits, runs, out, is_odd, most, stop, reached, 1);
    else
        go_on(model, work, initial, grid, n_times, key, first_run, limits, runs, out, is_odd, most, stop, reached, 0);
}
