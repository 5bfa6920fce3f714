# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A tank of cubes
#
# Cubes drift in an agitated tank, collide, and bond. Before you build such a tank you want to know how fast they move,
# whether neighbours move together, what happens if they sink, and whether a simulation of it has steps that are fine
# enough.
#
# A *scene* is a list of effects; nothing else is simulated. This notebook
#
# 1. reads a scene, removes effects and adds others;
# 2. looks at a run;
# 3. compares three kinds of agitation, and buoyancy, in short runs;
# 4. shows what accuracy costs: error against CPU time, from stored measurements (`results/accuracy`);
# 5. shows section V of the paper, run again (`results/section5`).
#
# Runs here are short, so that the notebook takes seconds; the stored studies took minutes to hours.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import SVG

from kinetics.support.plots import COLOURS
from mechsim import RunSpec, Scene, draw_tank, execute
from mechsim.accuracy.preset import load
from mechsim.inspection.pictures.movie import draw_strip
from mechsim.inspection.poses import Poses

plt.rcParams.update(
    {"figure.constrained_layout.use": True, "font.size": 9, "axes.prop_cycle": plt.cycler(color=COLOURS)}
)
results = Path("..") / "results"

# %% [markdown]
# ## 1. A scene

# %%
scene = Scene.load("line4")
pd.DataFrame(
    {
        "settings": {
            e.effect: ", ".join(f"{k} = {v}" for k, v in e.as_dict(without={"effect"}).items()) for e in scene.effects
        }
    }
)

# %% [markdown]
# Any effect can be left out, and any setting changed; a contradictory scene is refused, with the reason.

# %%
free = scene.without("bonding", "breaking")
try:
    scene.without("drag")
except ValueError as error:
    print(error)

# %% [markdown]
# ## 2. A run
#
# The same seed gives the same run, bit for bit, for any number of workers. Poses are recorded on request.

# %%
eager = scene.changed("bonding", latch={"kind": "encounter", "probability": 1.0})
record = execute(RunSpec(eager, {"monomer": 40}, 30.0, seed=1, run=0, poses=1.0))
print(f"{len(record.arrays['times'])} events, {record.outcome}, {record.cost['cpu_seconds']:.1f} s of CPU time")
fig, ax = plt.subplots(figsize=(4, 5))
draw_tank(record, ax)

# %%
poses = Poses.of(record)
_ = draw_strip(poses, plt.figure(figsize=(10, 3)), poses.spread(5))

# %% [markdown]
# ## 3. Effects
#
# The same 30 cubes under the paper's agitation (held for a time), under agitation that is correlated in time
# (Ornstein-Uhlenbeck), and in a flow field that moves neighbours together. Speeds are computed from poses 0.1 tu apart.

# %%
tanks = {}
for effect in (
    {"effect": "agitation", "sigma": 4.0, "hold": 0.0105},
    {"effect": "ornstein-uhlenbeck", "sigma": 4.0, "correlation_time": 0.00525},
    {"effect": "random-field", "sigma": 0.6, "correlation_length": 0.5, "correlation_time": 0.5},
):
    described = free.as_dict()
    described["effects"] = [effect if e["effect"] == "agitation" else e for e in described["effects"]]
    tanks[effect["effect"]] = Poses.of(
        execute(RunSpec(Scene(**described), {"monomer": 30}, 6.0, seed=1, run=0, poses=0.1))
    )

fig, (left, right) = plt.subplots(1, 2, figsize=(8, 3))
for name, seen in tanks.items():
    moved = np.diff(seen.centres, axis=0)
    left.hist(np.linalg.norm(moved, axis=2).ravel() / 0.1, bins=40, histtype="step", density=True, label=name)
    apart = np.linalg.norm(seen.centres[:-1, :, None] - seen.centres[:-1, None], axis=3)
    alike = np.einsum("fik,fjk->fij", moved, moved) / np.mean(np.sum(moved**2, axis=2))
    bins = np.arange(0.2, 2.2, 0.2)
    where = np.digitize(apart, bins)
    near = [alike[(where == k) & (apart > 0)].mean() for k in range(1, len(bins))]
    right.plot((bins[1:] + bins[:-1]) / 2, near, "o-", label=name)
left.set(xlabel="distance moved in 0.1 tu, over 0.1 tu (length/tu)", ylabel="density")
right.set(xlabel="distance of two cubes (length)", ylabel="correlation of their moves")
right.axhline(0, color="grey", lw=0.8)
left.legend(frameon=False)
# %% [markdown]
# Cubes that are not neutrally buoyant rise or sink: one more effect in the list.

# %%
described = free.as_dict()
described["cubes"]["density"] = 1.2
described["effects"].append({"effect": "buoyancy", "gravity": 9.0})
sinking = execute(RunSpec(Scene(**described), {"monomer": 40}, 10.0, seed=1, run=0, poses=0.5))
heights = Poses.of(sinking).centres[..., 2]
fig, ax = plt.subplots(figsize=(5, 3))
ax.plot(sinking.arrays["pose_times"], heights.mean(axis=1))
ax.set(xlabel="time (tu)", ylabel="mean height (length)")
# %% [markdown]
# ## 4. What accuracy costs
#
# `wellmixed trust accuracy mechanics line4` compares every numerical setting with a fine reference, together with its
# cost. The settings of the model have their own panel: they are not errors, and they matter more.

# %%
SVG(filename=str(results / "accuracy" / "line4.svg"))

# %% [markdown]
# Recommended settings are presets; each states its expected error and cost before it runs.

# %%
for name in ("draft", "standard", "reference"):
    print(load(name, scene).expected(cubes=60, simulated=200.0))

# %% [markdown]
# ## 5. Section V, run again
#
# Time to the first T of five cubes against the number of cubes. In the paper it falls as 1/N; here it falls faster, as
# it does in the Markov chain.

# %%
pd.read_csv(results / "section5" / "number_points.csv")

# %%
SVG(filename=str(results / "section5" / "number.svg"))
