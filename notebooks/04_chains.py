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
# # Pumps and rare events
#
# Three pumps keep a plant from running dry, and one mechanic repairs them. How likely is it that all three fail within
# a year, what does a year cost, and which should be better, the pumps or the mechanic? All of this is a continuous-time
# Markov chain, given by a matrix of rates. Every answer has a lower and an upper bound, and says whether they are
# proven. This notebook
#
# 1. makes a chain from a **matrix**, with labels and rewards, and asks questions as text;
# 2. writes it as **explicit files** for PRISM, which Storm reads as well;
# 3. solves a **stiff** chain, and shows what accuracy costs in time;
# 4. computes the probability of a **rare** event to many digits, and shows how it happens;
# 5. finds which rate matters, by exact **derivatives**.

# %%
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.sparse import csr_array, eye_array, kron

from kinetics import Chain, Collocation, Reward, Sensitivity
from kinetics.markov import ask, chain_path, chain_path_to, read_explicit, write_explicit
from kinetics.markov.transient.uniformisation import DiscreteChain
from kinetics.trust.hardcases.chains import machines

plt.rcParams.update({"figure.constrained_layout.use": True, "font.size": 9})

# %% [markdown]
# ## 1. A chain from outside
#
# Three pumps, each of which fails once in 1,000 hours, and one mechanic, who repairs one in 8 hours. A state is the
# number of pumps that have failed; rates from row to column, off the diagonal. The mechanic costs 5 per working hour,
# and each repair needs a spare part for 300: a reward accrues at a rate in each state, or as an impulse at each jump.

# %%
fail, repair = 1e-3, 1 / 8
failed = np.arange(4)
rates = np.diag((3 - failed[:-1]) * fail, 1) + np.diag(np.full(3, repair), -1)
cost = Reward(5.0 * (failed > 0), 300.0 * (np.diag(np.ones(3), -1)))
pumps = Chain(
    rates, initial=0, labels={"dry": failed == 3}, rewards={"cost": cost}, variables=["failed"], counts=failed[:, None]
)
pumps

# %% [markdown]
# Questions are methods (`pumps.until("dry", by=8760)`), or text in the notation of PRISM and Storm: the probability of
# running dry within a year, or of never having two pumps failed for that long; the share of time with a pump failed;
# the cost of a year, and the mean time until dry.

# %%
questions = [
    'P=? [ F<=8760 "dry" ]',
    "P=? [ G<=8760 failed < 2 ]",
    "P=? [ failed < 2 U<=8760 failed = 2 ]",
    "S=? [ failed >= 1 ]",
    'R{"cost"}=? [ C<=8760 ]',
    'R{"cost"}=? [ S ]',
]
answers = pd.DataFrame({question: asdict(ask(pumps, question)) for question in questions}).T
answers["relative width"] = ((answers["high"] - answers["low"]) / answers["value"]).map("{:.0e}".format)
answers[["value", "relative width", "kind", "method"]]

# %% [markdown]
# The bounds include truncation and all rounding, that of the rates as well. The time itself has a distribution, with
# quantiles:

# %%
dry = pumps.passage("dry")
pd.Series({"mean (h)": dry.mean, "sd (h)": dry.sd, "relative error": dry.error, "median (h)": float(dry.quantile(0.5))})

# %% [markdown]
# ## 2. As files
#
# PRISM's explicit files hold states, rates, labels and rewards as text. Written and read back, the chain is the same to
# the last bit.

# %%
with TemporaryDirectory() as folder:
    write_explicit(pumps, Path(folder) / "pumps.tra")
    written = {path.name: path.read_text() for path in sorted(Path(folder).iterdir())}
    back = read_explicit(Path(folder) / "pumps.tra")
print(written["pumps.tra"], written["pumps.lab"], sep="\n")
same = [ask(back, question).value == ask(pumps, question).value for question in questions]
sorted(written), all(same)

# %% [markdown]
# ## 3. Stiff
#
# Two independent groups of machines: 20 fast ones fail every hour and are repaired in 30 seconds, 15 slow ones fail
# once a year and are repaired in four months. After ten years the exact answer is a product of two binomial
# distributions.

# %%
ten_years = 3.2e8
(quick, first), (slow, second) = machines(20, 3e-4, 3e-2, ten_years), machines(15, 3e-8, 1e-7, ten_years)
generator = kron(csr_array(quick), eye_array(16)) + kron(eye_array(21), csr_array(slow))
exact = np.outer(first, second).ravel()
stiff = Chain(generator, initial=0)
uniform = DiscreteChain.of(stiff.transitions)
steps = uniform.rate * ten_years
slowest, fastest = generator.data[generator.data > 0].min(), generator.data.max()
seconds, rounding = steps * uniform.step_seconds, uniform.rounding(steps)
print(f"{len(stiff)} states, rates from {slowest:.0e} to {fastest:.0e} per second")
print(f"uniformisation would take {steps:.1e} steps, some {seconds:.0f} s, and bound its rounding by {rounding:.0e}")

# %% [markdown]
# Uniformisation takes steps as short as the fastest rate requires. `Collocation` takes steps as long as the time before
# them: the solution on each is a polynomial, corrected until its defect, computed in exact fixed-point arithmetic, is
# small. The integral of the defect bounds the error. What accuracy costs:

# %%
found = {tolerance: stiff.transient([ten_years], Collocation(tolerance)) for tolerance in (1e-4, 1e-7, 1e-10, 1e-13)}
price = pd.DataFrame(
    {
        "requested": list(found),
        "proven error": [one.error for one in found.values()],
        "error": [np.abs(one.probabilities[0] - exact).sum() for one in found.values()],
        "CPU (s)": [one.cpu_seconds for one in found.values()],
    }
)
price.style.format({"requested": "{:.0e}", "proven error": "{:.1e}", "error": "{:.1e}", "CPU (s)": "{:.2f}"})

# %%
figure, ax = plt.subplots(figsize=(4.5, 3.2))
ax.loglog(price["CPU (s)"], price["proven error"], "o-", label="proven")
ax.loglog(price["CPU (s)"], price["error"], "s--", label="against the closed form")
ax.axvline(seconds, color="0.5", ls=":", label="uniformisation, forecast")
ax.set_xlabel("processor time (s)")
ax.set_ylabel("summed error of 336 probabilities")
_ = ax.legend(frameon=False)

# %% [markdown]
# Nine more digits cost a small factor in time. (The closed form is itself rounded, to some 1e-15.)
#
# ## 4. Rare
#
# A cluster of particles gains particles at a rate proportional to its surface, and loses them faster the more curved it
# is: small clusters dissolve, and beyond a critical size they keep growing. What is the probability that a cluster
# reaches 60 particles before it dissolves?

# %%
size = np.arange(61)
gain = np.append(0.0, size[1:60] ** (2 / 3))
loss = size[1:] ** (2 / 3) * np.exp(4.5 / size[1:] ** (1 / 3) - 1.3)
loss[-1] = 0.0
cluster = Chain(
    np.diag(gain, 1) + np.diag(loss, -1),
    initial=1,
    labels={"grown": size == 60},
    variables=["size"],
    counts=size[:, None],
)
ever = cluster.until("grown")
print(ever)

# %% [markdown]
# The bounds are relative, so the digits are correct however small the number, even at early times, when it is far
# smaller still. A forward pass over all states gives each probability only to within the rounding error of 1.

# %%
times = np.geomspace(0.5, 300, 16)
soon = [cluster.until("grown", by=time) for time in times]
forwards = cluster.transient(times)
rare = pd.DataFrame([asdict(one) for one in soon], index=times.round(2))
rare["relative width"] = (rare["high"] - rare["low"]) / rare["value"]
rare.iloc[::3][["value", "relative width", "kind"]]

# %%
paths = [chain_path_to(cluster, "grown", seed=1, run=run) for run in range(6)]
usual = [chain_path(cluster, 30.0, seed=2, run=run) for run in range(40)]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
left.loglog(times, rare["value"], "o-", ms=3, label="until, backwards: relative bounds")
left.axhline(forwards.error, color="0.5", ls=":", label="proven error of a forward pass")
left.axhline(ever.value, color="0.3", lw=0.8, label="ever")
left.set_xlabel("time")
left.set_ylabel("probability of 60 by then")
left.legend(frameon=False)
for path in usual:
    right.step(path.times, path.states, where="post", color="0.6", lw=0.6)
for path in paths:
    right.step(path.times, path.states, where="post", lw=0.9)
right.set_xlim(0, None)
right.set_xlabel("time")
_ = right.set_ylabel("particles in the cluster")

# %% [markdown]
# Right: in grey 40 ordinary clusters, all of which soon dissolve; in colour six that grow, drawn from the exact
# distribution of such runs. No run was discarded for this: each jump is weighted by the probability of success from the
# state it leads to (Doob's transform). The rare event is fast once it happens: it takes some 10 to 30 units of time,
# but occurs once in 3e11 clusters on average.

# %% [markdown]
# ## 5. Derivatives
#
# One forward and one backward pass, or one elimination, give the derivatives of an answer by all parameters at once,
# with bounds as well. The parameters of a network's chain are its rate constants; those of any other chain are named,
# each with the rates proportional to it. Below are the elasticities (relative change per relative change) of three
# answers about the pumps. Running dry takes three failures in a row, so the failure rate counts almost threefold, and
# the repair rate almost minus twofold; the cost of a year hardly depends on the repair rate.

# %%
sensitivity = Sensitivity(pumps, {"fail": np.triu(rates) > 0, "repair": np.tril(rates) > 0})
derivatives = {
    "dry within a year": sensitivity.until("dry", by=8760),
    "mean time until dry": sensitivity.passage("dry"),
    "cost of a year": sensitivity.reward("cost", up_to=8760),
}
wanted = ["elasticity", "elasticity_low", "elasticity_high"]
pd.concat({name: pd.DataFrame(one.to_dict(), columns=["parameters", *wanted]) for name, one in derivatives.items()})

# %% [markdown]
# The elasticities of a mean time add up to −1: if all rates double, the time halves.

# %%
float(derivatives["mean time until dry"].elasticity.sum())
