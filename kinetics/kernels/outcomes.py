"""Outcome codes that kernels return for a run or a part of one."""

REACHED_END = 0  # also if nothing can happen any more
UNFINISHED = 1  # all is well, but draws or buffers are used up: call again with fresh ones
STALLED_CLOCK = 2  # `clock.MOST_STILL` events in a row did not move the clock
OVERFLOW = 3  # a count beyond int64, or a propensity beyond double

# Of runs under rate laws and events; `GeneralWork.notes` says of which channel, event or count an outcome speaks.
BAD_LAW = 4  # a propensity below 0, infinite or undefined
UNBOUNDED = 5  # no bound of a channel's rate law over any window
BROKEN_BOUND = 6  # a propensity above its bound: an error in the kernel
BAD_COUNT = 7  # an event's new count is no whole number of at least 0
UNDECIDED = 8  # when a condition turns true cannot be decided
ENDLESS = 9  # events of one moment set each other off
BAD_DELAY = 10  # an event's delay is no number of at least 0
CROWDED = 11  # too many delayed events wait

# Given to a run between calls, see `sampling.watch`.
MOST_EVENTS = 12  # it has made as many events as it may
ENDLESS_RUN = 13  # its rate equations forecast more events than allowed
STOPPED = 14  # the condition holds at which it is to end
