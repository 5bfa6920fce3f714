/* Gillespie's direct method (1977, doi:10.1021/j100540a008): the arithmetic of direct.py, to the last bit. */

#include "sampling.h"
#include "streams.h"
#include "thinning.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double *copies;      /* (S + 1 + sums,), the counts, 1, and the sums of the terms */
    double *propensities, *within, *upto;
    int64_t *counts;     /* (S,) */
} Room;

/* The propensity of a channel of any order: its coefficient times falling factors of the counts. */
INLINE double factored(const Model *model, int64_t r, const int64_t *counts)
{
    double propensity = model->coefficients[r];
    for (int64_t j = 0; j < model->most_factors; j++) {
        const int64_t *factor = model->factors + 3 * (r * model->most_factors + j);
        const int64_t copies = factor[0] < model->n_species ? counts[factor[0]] : 1;
        propensity *= (double)(copies >= factor[2] ? copies - factor[1] : 0);
    }
    return propensity;
}

/* Step 1 of the direct method: all propensities and their running sums by blocks; returns their sum a_0. */
INLINE double total_propensity(const Model *model, const Room *room)
{
    double *copies = room->copies, part = 0.0, total = 0.0;
    /* Sums over partners that merged channels share; their channels read them like counts. */
    for (int64_t k = 0; k < model->n_terms; k++) {
        const double *term = model->terms + 4 * k;
        part += term[0] * (copies[(int64_t)term[1]] - term[2]);
        if (term[3] > 0.0) {
            copies[(int64_t)term[3]] = part;
            part = 0.0;
        }
    }
    for (int64_t r = 0; r < model->n_channels; r++) {
        const double pair = model->coefficients[r] * copies[model->first[r]];
        room->propensities[r] = pair * (copies[model->second[r]] - model->less[r]);
    }
    if (model->any_general)
        for (int64_t r = 0; r < model->n_channels; r++)
            if (model->is_general[r])
                room->propensities[r] = factored(model, r, room->counts);
    for (int64_t block = 0; block < model->n_blocks; block++) {
        part = 0.0;
        for (int64_t r = BLOCK * block; r < BLOCK * (block + 1); r++) {
            part += room->propensities[r];
            room->within[r] = part;
        }
        total += part;
        room->upto[block] = total;
    }
    return total;
}

/* Step 3: the first channel whose running sum exceeds the target (eq. 21b). If rounding makes the target too large, the
 * second comparison stops at the last positive propensity: no channel without reactants fires. */
INLINE int64_t chosen_channel(const Room *room, double target, double total)
{
    int64_t block = 0;
    while (room->upto[block] <= target && room->upto[block] < total)
        block++;
    if (block > 0)
        target -= room->upto[block - 1];
    int64_t chosen = BLOCK * block;
    const double part = room->within[chosen + BLOCK - 1];
    while (room->within[chosen] <= target && room->within[chosen] < part)
        chosen++;
    return chosen;
}

/* The rate of events, and of candidates in a crowd. */
INLINE double with_candidates(const Thinning *thinning, const Room *room, double total)
{
    return thinning ? total + thinning->ratio * (total - uncrowded(thinning, room->within, room->upto, 1)) : total;
}

/* The channel at a target within the events, whose total is `surely`, and candidates: n_channels where nothing is
 * changed. */
INLINE int64_t event_channel(const Model *model, const Thinning *thinning, const Room *room, double target,
                             double surely, double total)
{
    if (thinning && target >= surely && surely < total)
        return kept_channel(model, room->within, room->copies, 1, target - surely);
    return chosen_channel(room, target, total);
}

/* An event has left the clock at t: clock.stands_still. */
static RARE int stands_still(double *clock, double t)
{
    clock[1] = clock[2] == t ? clock[1] + 1.0 : 1.0;
    clock[2] = t;
    return clock[1] >= MOST_STILL ? STALLED_CLOCK : UNFINISHED;
}

/* Draw when the next event comes: inf where none does. */
INLINE int next_time(double t, double total, uint64_t *s, double *later, double *clock)
{
    const double wait = exponential(next_word(s, s + 1, s + 2, s + 3));
    if (!(total < INFINITY))
        return OVERFLOW_;
    *later = total > 0.0 ? t + wait / total : INFINITY;
    return *later == t ? stands_still(clock, t) : UNFINISHED;
}

/* Change the counts by a channel; whether they are all within 63 bits. */
INLINE int fire(const Model *model, const Room *room, int64_t channel)
{
    const int64_t *change = model->changes + model->n_species * channel;
    int is_right = 1;
    for (int64_t i = 0; i < model->n_species; i++) {
        room->counts[i] = (int64_t)((uint64_t)room->counts[i] + (uint64_t)change[i]);
        room->copies[i] = (double)room->counts[i];
        is_right &= room->counts[i] >= 0;
    }
    return is_right;
}

/* Take back what a channel changed, where a count went beyond 63 bits. */
static RARE int overflowed(const Model *model, const Room *room, int64_t channel)
{
    for (int64_t i = 0; i < model->n_species; i++)
        room->counts[i] = (int64_t)((uint64_t)room->counts[i] - (uint64_t)model->changes[model->n_species * channel + i]);
    return OVERFLOW_;
}

/* Put a run at its initial counts. */
static void begin(const Model *model, const int64_t *counts, const Room *room)
{
    for (int64_t k = 0; k < model->n_species; k++) {
        room->counts[k] = counts[k];
        room->copies[k] = (double)counts[k];
    }
    room->copies[model->n_species] = 1.0;
}

/* Whether the condition holds: stopping.holds. */
static int holds(const Stop *stop, const int64_t *counts)
{
    int64_t place = 0;
    while (place >= 0) {
        const double *row = stop->table + place, *end = row + TERMS + 2 * (int64_t)row[N_TERMS];
        double total = 0.0;
        for (const double *term = row + TERMS; term < end; term += 2)
            total += term[1] * (double)counts[(int64_t)term[0]];
        place = (int64_t)(row[LOW] <= total && total <= row[HIGH] ? row[YES] : row[NO]);
    }
    return place == HOLDS;
}

/* Where a run stands. */
typedef struct {
    double clock[3];
    int64_t passed, n_events;
    uint64_t stream[4];
} Standing;

/* Go on with a run until it has passed so many times of the grid, or has had so many events. */
INLINE int advance(const Model *model, const Room *room, const double *grid, int64_t n_times, int64_t last,
                   Standing *at, int64_t *out, const Stop *stop, const Thinning *thinning)
{
    const int64_t n_species = model->n_species;
    uint64_t s[4]; /* copies, which the compiler keeps in registers */
    memcpy(s, at->stream, sizeof s);
    double t = at->clock[0];
    int64_t passed = at->passed, n_events = at->n_events;
    int outcome = passed < n_times ? UNFINISHED : REACHED_END;
    while (outcome == UNFINISHED && n_events < last) {
        const double surely = total_propensity(model, room), total = with_candidates(thinning, room, surely);
        double later;
        outcome = next_time(t, total, s, &later, at->clock);
        if (outcome != UNFINISHED)
            break;
        /* Counts are constant until the event: write them at all times of the grid before it. */
        for (; passed < n_times && grid[passed] < later; passed++)
            memcpy(out + passed * n_species, room->counts, (size_t)n_species * sizeof *out);
        if (passed == n_times) {
            outcome = REACHED_END;
            break;
        }
        t = later;
        const double share = uniform(next_word(s, s + 1, s + 2, s + 3));
        const int64_t chosen = event_channel(model, thinning, room, share * total, surely, total);
        if (!(thinning && chosen == model->n_channels) && !fire(model, room, chosen)) {
            outcome = overflowed(model, room, chosen);
            break;
        }
        n_events++;
        if (stop && stop->affects_stop[chosen] && holds(stop, room->counts))
            outcome = STOPPED;
    }
    memcpy(at->stream, s, sizeof s);
    at->clock[0] = t, at->passed = passed, at->n_events = n_events;
    return outcome;
}

static int go_on(const Model *model, const Room *room, const double *grid, int64_t n_times, int64_t last, Standing *at,
                 int64_t *out)
{
    return advance(model, room, grid, n_times, last, at, out, NULL, NULL);
}

static int go_on_until(const Model *model, const Room *room, const double *grid, int64_t n_times, int64_t last,
                       Standing *at, int64_t *out, const Stop *stop)
{
    return advance(model, room, grid, n_times, last, at, out, stop, NULL);
}

static int go_on_thinned(const Model *model, const Room *room, const double *grid, int64_t n_times, int64_t last,
                         Standing *at, int64_t *out, const Stop *stop)
{
    return advance(model, room, grid, n_times, last, at, out, stop, model->thinning);
}

/* One block of memory, divided among the arrays of a workspace; NULL if there is none. */
static double *make_room(const Model *model, const int64_t *counts, Room *room)
{
    const int64_t n_species = model->n_species, n_slots = model->n_blocks * BLOCK;
    double *memory = calloc((size_t)(2 * n_species + 2 + model->n_sums + 2 * n_slots + model->n_blocks), sizeof *memory);
    if (!memory)
        return NULL;
    room->copies = memory;
    room->propensities = room->copies + n_species + 1 + model->n_sums;
    room->within = room->propensities + n_slots;
    room->upto = room->within + n_slots;
    room->counts = (int64_t *)(room->upto + model->n_blocks);
    begin(model, counts, room);
    return memory;
}

enum { RUN, PASSED, EVENTS, LOOK }; /* as in direct.py */
#define BEFORE (-1)

/* `direct.ensemble`: the outcome, -1 without memory. The grid has n_times times. */
int direct(const Model *model, int64_t *counts, double *clock, uint64_t *stream, int64_t *notes, const int64_t *initial,
           const double *grid, int64_t n_times, const uint64_t *key, int64_t first_run, const int64_t *limits,
           int64_t runs, int64_t *out, int64_t most, const Stop *stop, double *reached)
{
    Room room;
    Standing at;
    double *memory = make_room(model, counts, &room);
    int outcome = memory ? REACHED_END : -1;
    memcpy(at.stream, stream, sizeof at.stream);
    memcpy(at.clock, clock, sizeof at.clock);
    at.passed = notes[PASSED], at.n_events = notes[EVENTS];
    while (outcome == REACHED_END && notes[RUN] < runs) {
        if (at.n_events == BEFORE) {
            start_stream(key, first_run + notes[RUN], at.stream);
            begin(model, initial, &room);
            memset(at.clock, 0, sizeof at.clock);
            at.passed = at.n_events = 0;
            notes[LOOK] = limits[3];
        }
        const int64_t made = at.n_events, last = notes[LOOK] < made + most ? notes[LOOK] : made + most;
        const int64_t needed = notes[RUN] < limits[2] ? limits[0] : limits[1];
        int64_t *counts_of_run = out + notes[RUN] * n_times * model->n_species;
        outcome = model->thinning ? go_on_thinned(model, &room, grid, needed, last, &at, counts_of_run, stop)
                  : stop          ? go_on_until(model, &room, grid, needed, last, &at, counts_of_run, stop)
                                  : go_on(model, &room, grid, needed, last, &at, counts_of_run);
        if (outcome == STOPPED) {
            reached[notes[RUN]] = at.clock[0];
            for (; at.passed < needed; at.passed++)
                memcpy(counts_of_run + at.passed * model->n_species, room.counts,
                       (size_t)model->n_species * sizeof *counts_of_run);
            outcome = REACHED_END;
        }
        most -= at.n_events - made;
        if (outcome == REACHED_END) {
            most--;
            notes[RUN]++;
            at.n_events = BEFORE;
        }
    }
    if (memory)
        memcpy(counts, room.counts, (size_t)model->n_species * sizeof *counts);
    memcpy(stream, at.stream, sizeof at.stream);
    memcpy(clock, at.clock, sizeof at.clock);
    notes[PASSED] = at.passed, notes[EVENTS] = at.n_events;
    free(memory);
    return outcome;
}

INLINE int followed(const Model *model, int64_t *counts, double *clock, const double *end, uint64_t *stream,
                    double *times, int64_t *fired, int64_t most, int64_t *n_events, const Stop *stop,
                    const Thinning *thinning)
{
    Room room;
    double t = clock[0], *memory = make_room(model, counts, &room);
    int outcome = memory ? UNFINISHED : -1;
    *n_events = 0;
    while (outcome == UNFINISHED && *n_events < most) {
        const double surely = total_propensity(model, &room), total = with_candidates(thinning, &room, surely);
        double later;
        outcome = next_time(t, total, stream, &later, clock);
        if (outcome != UNFINISHED)
            break;
        t = later;
        if (later > *end) {
            t = *end;
            outcome = REACHED_END;
            break;
        }
        const double share = uniform(next_word(stream, stream + 1, stream + 2, stream + 3));
        const int64_t channel = event_channel(model, thinning, &room, share * total, surely, total);
        if (!(thinning && channel == model->n_channels) && !fire(model, &room, channel)) {
            outcome = overflowed(model, &room, channel);
            break;
        }
        times[*n_events] = t;
        fired[(*n_events)++] = channel;
        if (stop && stop->affects_stop[channel] && holds(stop, room.counts))
            outcome = STOPPED;
    }
    if (memory)
        memcpy(counts, room.counts, (size_t)model->n_species * sizeof *counts);
    clock[0] = t;
    free(memory);
    return outcome;
}

/* Go on with a run until `end`, or until the buffers of events are full: the outcome, -1 without memory. */
int events(const Model *model, int64_t *counts, double *clock, const double *end, uint64_t *stream, double *times,
           int64_t *fired, int64_t most, int64_t *n_events, const Stop *stop)
{
    if (model->thinning)
        return followed(model, counts, clock, end, stream, times, fired, most, n_events, stop, model->thinning);
    return followed(model, counts, clock, end, stream, times, fired, most, n_events, stop, NULL);
}
