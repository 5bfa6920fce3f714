"""The tuning constants of adaptive prediction (`predict --accuracy`), all of them, each with what measured it.

- bench: `python -m tests.benchmarks.bench_accuracy`, 200 questions: whether the accuracy was kept, and at what cost
- timed: CPU time on a 2-core virtual machine
- test: a test in tests/kinetics/predicting fails, or computes another chance, if the constant is far off
- choice: nothing measured this number, and the reason for it is given

Only those under "Stopping rule" and "Forced firings" decide how often an answer is right; the others decide what is
tried, in which order, and for how long.
"""

from __future__ import annotations

import numpy as np

# ---- What may be asked
LEAST = 1e-12  # least error; choice: doubles hold sixteen digits, of which sums over many states cost a few
LEVEL = 0.95  # confidence for all figures together; choice: the custom of the field
TENFOLD = 10.0  # so much smaller an error is forecast in the report; choice: one digit more
BUDGET = 1200.0  # s; choice: what people wait for without having allowed it

# ---- States that are listed, and solutions over them
FEW_STATES = 1000  # listed before anything else is tried; timed: 0.4 to 0.6 ms
LIST_SECONDS, LIST_SPECIES = 3e-7, 3.3e-8  # s a state at least, and for each species; timed: 5e-7 at 4 species
SOLVE_SECONDS, TIME_SECONDS = 8e-4, 2e-5  # s of any solution, and for each time; timed: 9e-4 for one, 3e-3 for 100
LISTING = 0.05  # share of the forecast cost of runs that state enumeration may take; choice: if wasted, it is small
QUICK = 3e-3  # s of a solution that is taken at once; choice: about what the first runs and forced firings cost

# ---- Projections, whose cost shows only as they go
TRIED = 0.01  # s that every other way takes before one is tried; choice: below, a trial costs as much as the answer
PROJECTING = 0.5  # share of the cheapest other way that one may take; choice: tried in vain, an answer costs half more
TRIAL = 0.2  # share of that after which the rest is forecast; choice: giving up is final, so not as early as 0.02

# ---- First runs, which say what a run costs and how many are needed
FIRST_RUNS = 16  # choice: two vectors of lanes, which know a variance to a third; timed: no dearer than 8
FOLLOWING = 0.5  # share of the cost of a solution that they may take; choice: as PROJECTING
FIRST_EVENTS = 2e3  # of the first stretch of a run; choice: a millisecond for all of them
STRETCH = 30.0  # growth of stretches, at most; bench: 60 questions cost 2.7 s, as with 8 to 500 by turns
LOOKED_AT = np.linspace(0.0, 1.0, 33) ** 3  # of a stretch: most where stiff chains are busy; test "where they crowd"
FEWEST_COUNTED, PROPENSITIES = 2, 2**17  # runs in which events are counted; timed: so many propensities take some 3 ms
FIRST_SECONDS, MOST_FIRST = 2e-3, 256  # work and runs that forecast those needed; choice: about QUICK; variances to 9 %
OUTPUT, STATISTICS = 6e-9, 1e-3  # s of a count in the statistics, and of all; timed: 5e-9 of 10,000 runs, 1e-3 of 100
THREADED = 0.02  # s of work for which threads are started; timed: starting two takes 2e-4 of CPU, and more of a clock
LANES = 8  # runs that cost as much as one; timed: 16 take no more than 8, a vector of which is 8 doubles wide

# ---- Stopping rule: whether runs are enough
ALLOWED = 0.9  # share of the chance to be wrong for an interim look; test "looks at normal figures" computes it
FEW = 64  # runs that may not have shown rare events yet; choice: those in one of 22 runs have shown by 95 %
CAREFUL = 0.05  # share of that for looks at fewer, if channels cannot be forced; bench: misses of bursts halved
GROWTH, LEAST_GROWTH = 8, 1.02  # of the runs until the next look; test "looks at normal figures" computes with them
MARGIN = 1.05  # times the runs forecast are made; choice: their variance is an estimate, and a look costs 0.1 to 0.7 ms
ROWS, ROW_BYTES = 64, 2**25  # runs kept for their correlations; test "correlated figures count once"
DRAWN = 600  # draws of the largest error; choice: a 95 % quantile within 1 %, and 27 draws above it
SMALL = 0.5  # share of the largest error below which figures matter to no quantile; choice: 2 against 4 sigmas
ONE_THREAD = 2**18  # multiplications at a time; choice: for more, BLAS wakes threads

# ---- Forced firings
SELDOM = 30.0  # firings in all runs needed, below which a channel is forced; test "few forced runs miss" at 10
NEVER = 0.01  # firings of all channels together that are not forced; choice: small beside the chance of 5 %
TIMES, FORCED_RUNS = 3, 64  # times at which a channel is forced, and runs of each; test "few forced runs miss" at 4
MOST_FORCED = 192  # channels, and with their times; choice: two calls of a kernel for each, 20 ms
BEYOND = 0.5  # widths of the range shown, by which a count is outside; choice: 64 more runs of one law hardly are
SHOWN = 30  # runs outside, which say enough themselves; choice: as SELDOM
SHARE = 0.25  # of the runs needed that are forced at most, and of their events; choice: wasted, it costs a quarter
FORCED_EVENTS = 3e6  # allowed in any case; choice: 0.1 s; test "unlikely turns" needs 12,000 events in a forced run
FORCED_COUNTS = 2**22  # kept; choice: 128 MB while they enter moments
