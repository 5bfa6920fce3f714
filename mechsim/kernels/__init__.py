"""Compiled kernels of the mechanics: arrays in, arrays out; they import numpy and numba only.

A module of them is imported, and Numba with it, when something of it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from mechsim.kernels import contact as contact
    from mechsim.kernels import fluid as fluid
    from mechsim.kernels import forces as forces
    from mechsim.kernels import loads as loads
    from mechsim.kernels import motion as motion

__getattr__, __dir__ = lazy_names(__name__)
