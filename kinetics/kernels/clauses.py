"""Satisfiability by conflict-driven clause learning: first unique implication points, two watched literals, restarts.

Variable v gives the literals 2 v, true where it is, and 2 v + 1. After Een & Sörensson (2003,
doi:10.1007/978-3-540-24605-3_37); restarts after Luby, Sinclair & Zuckerman (1993, doi:10.1016/0020-0190(93)90029-9).
"""

import numpy as np

from kinetics.kernels.compiled import compiled

OPEN, UNSATISFIABLE, SATISFIABLE, FULL = 0, 1, 2, 3
RESTART = 100  # conflicts, times Luby's numbers
DECAY = 0.95  # of the activity of a variable from conflict to conflict
LARGE = 1e100


@compiled
def _rise(heap, place, activity, at):
    """Move a variable up the heap of variables, the most active first."""
    var = heap[at]
    while at > 0:
        above = (at - 1) >> 1
        if activity[heap[above]] >= activity[var]:
            break
        heap[at] = heap[above]
        place[heap[at]] = at
        at = above
    heap[at] = var
    place[var] = at


@compiled
def _sink(heap, place, activity, size):
    """Move the first variable down the heap to where it belongs."""
    var, at = heap[0], 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and activity[heap[below + 1]] > activity[heap[below]]:
            below += 1
        if activity[heap[below]] <= activity[var]:
            break
        heap[at] = heap[below]
        place[heap[at]] = at
        at = below
    heap[at] = var
    place[var] = at


@compiled
def _luby(n):
    """1, 1, 2, 1, 1, 2, 4, ... for n = 0, 1, ..."""
    size, power = 1, 1
    while size < n + 1:
        size, power = 2 * size + 1, 2 * power
    while size - 1 != n:
        size >>= 1
        power >>= 1
        n %= size
    return power


@compiled
def _propagate(literals, starts, heads, following, values, trail, done, known, level, levels, reasons):
    """Draw all consequences of the literals on the trail from `done` on: (clause in conflict or -1, trail's length)."""
    while done < known:
        false = trail[done] ^ 1
        done += 1
        node = heads[false]
        heads[false] = -1
        while node >= 0:
            after = following[node]
            clause, own = node >> 1, node & 1
            start = starts[clause]
            other = literals[start + 1 - own]
            moved = False
            if values[other] != 1:
                for i in range(start + 2, starts[clause + 1]):
                    new = literals[i]
                    if values[new] != -1:
                        literals[i], literals[start + own] = false, new
                        following[node], heads[new] = heads[new], node
                        moved = True
                        break
            if not moved:
                following[node], heads[false] = heads[false], node
                if values[other] == -1:
                    while after >= 0:
                        node, after = after, following[after]
                        following[node], heads[false] = heads[false], node
                    return clause, known
                if values[other] == 0:
                    values[other], values[other ^ 1] = 1, -1
                    levels[other >> 1], reasons[other >> 1] = level, clause
                    trail[known] = other
                    known += 1
            node = after
    return -1, known


@compiled
def solve(literals, starts, n_clauses, assumed, activity, phase, values, most):
    """Look for values under which all clauses hold, the assumed literals among them: (status, clauses, conflicts).

    literals, starts : of each clause; learned clauses are put behind as long as there is room, else FULL is returned
    activity, phase : of each variable, kept from call to call: how often it was in conflicts, and its last value
    values : of each literal, 1 true, -1 false; filled here
    most : conflicts, after which OPEN is returned
    """
    n = activity.size
    heads, following = np.full(2 * n, -1, np.int64), np.empty(2 * (starts.size - 1), np.int64)
    trail, bounds = np.empty(n + 1, np.int64), np.empty(n + assumed.size + 2, np.int64)
    levels, reasons = np.zeros(n, np.int64), np.full(n, -1, np.int64)
    seen, learned = np.zeros(n, np.bool_), np.empty(n + 1, np.int64)
    heap, place = np.arange(n), np.arange(n)
    values[:] = 0
    size, known, done, level = 0, 0, 0, 0
    for var in range(n):
        heap[size] = var
        size += 1
        _rise(heap, place, activity, size - 1)
    for clause in range(n_clauses):
        start = starts[clause]
        if starts[clause + 1] - start == 1:
            unit = literals[start]
            if values[unit] == -1:
                return UNSATISFIABLE, n_clauses, 0
            if values[unit] == 0:
                values[unit], values[unit ^ 1] = 1, -1
                trail[known] = unit
                known += 1
        else:
            for own in range(2):
                node, watched = 2 * clause + own, literals[start + own]
                following[node], heads[watched] = heads[watched], node
    gain, conflicts, since, round_ = 1.0, 0, 0, 0
    limit = RESTART * _luby(0)
    while True:
        clause, known = _propagate(
            literals, starts, heads, following, values, trail, done, known, level, levels, reasons
        )
        done = known
        if clause >= 0:
            conflicts += 1
            since += 1
            if level == 0:
                return UNSATISFIABLE, n_clauses, conflicts
            count, length, at, literal = 0, 1, known - 1, -1
            while True:  # back to the one literal of this level through which all go
                for i in range(starts[clause], starts[clause + 1]):
                    one = literals[i]
                    var = one >> 1
                    if one == literal or seen[var] or levels[var] == 0:
                        continue
                    seen[var] = True
                    activity[var] += gain
                    if place[var] >= 0:
                        _rise(heap, place, activity, place[var])
                    if levels[var] == level:
                        count += 1
                    else:
                        learned[length] = one
                        length += 1
                while not seen[trail[at] >> 1]:
                    at -= 1
                literal = trail[at]
                clause = reasons[literal >> 1]
                seen[literal >> 1] = False
                at -= 1
                count -= 1
                if count == 0:
                    break
            learned[0] = literal ^ 1
            kept = 1
            for i in range(1, length):  # what follows from the others goes
                why = reasons[learned[i] >> 1]
                needed = why < 0
                if not needed:
                    for j in range(starts[why], starts[why + 1]):
                        var = literals[j] >> 1
                        if var != learned[i] >> 1 and not seen[var] and levels[var] > 0:
                            needed = True
                            break
                if needed:
                    learned[kept], learned[i] = learned[i], learned[kept]
                    kept += 1
            for i in range(1, length):
                seen[learned[i] >> 1] = False
            back = 0
            for i in range(1, kept):
                if levels[learned[i] >> 1] > back:
                    back = levels[learned[i] >> 1]
                    learned[1], learned[i] = learned[i], learned[1]
            gain /= DECAY
            if gain > LARGE:
                gain /= LARGE
                for var in range(n):
                    activity[var] /= LARGE
        elif since >= limit:
            round_ += 1
            since, limit, back, kept = 0, RESTART * _luby(round_), 0, 0
        else:
            back, kept = level, 0
        while level > back:  # undo
            level -= 1
            while known > bounds[level]:
                known -= 1
                var = trail[known] >> 1
                phase[var] = (trail[known] & 1) == 0
                values[2 * var], values[2 * var + 1] = 0, 0
                if place[var] < 0:
                    heap[size], place[var] = var, size
                    size += 1
                    _rise(heap, place, activity, size - 1)
            done = known
        if kept > 0:
            start = starts[n_clauses]
            if n_clauses + 2 > starts.size - 1 or start + kept + n > literals.size:
                return FULL, n_clauses, conflicts
            for i in range(kept):
                literals[start + i] = learned[i]
            starts[n_clauses + 1] = start + kept
            if kept > 1:
                for own in range(2):
                    node, watched = 2 * n_clauses + own, literals[start + own]
                    following[node], heads[watched] = heads[watched], node
            unit = literals[start]
            values[unit], values[unit ^ 1] = 1, -1
            levels[unit >> 1], reasons[unit >> 1] = level, n_clauses if kept > 1 else -1
            trail[known] = unit
            known += 1
            n_clauses += 1
            if conflicts >= most:
                return OPEN, n_clauses, conflicts
            continue
        if done < known:
            continue
        decided = -1
        while decided < 0 and level < assumed.size:
            if values[assumed[level]] == -1:
                return UNSATISFIABLE, n_clauses, conflicts
            if values[assumed[level]] == 0:
                decided = assumed[level]
            else:
                bounds[level] = known
                level += 1
        while decided < 0 and size > 0:
            var = heap[0]
            size -= 1
            place[var] = -1
            if size > 0:
                heap[0] = heap[size]
                _sink(heap, place, activity, size)
            if values[2 * var] == 0:
                decided = 2 * var if phase[var] else 2 * var + 1
        if decided < 0:
            return SATISFIABLE, n_clauses, conflicts
        bounds[level] = known
        level += 1
        values[decided], values[decided ^ 1] = 1, -1
        levels[decided >> 1], reasons[decided >> 1] = level, -1
        trail[known] = decided
        known += 1
