"""What the server of workers loads before it forks the first: the kernels of a step, which take half a second a run."""

from __future__ import annotations

from kinetics.kernels.compiled import load_cached
from mechsim.kernels import (
    contact,
    contact_solver,
    contact_step,
    fluid,
    forces,
    loads,
    motion,
    narrow_phase,
)

load_cached(contact, contact_solver, contact_step, fluid, forces, loads, motion, narrow_phase)
