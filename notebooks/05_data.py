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
# # The plague at Eyam
#
# In 1666 the village of Eyam shut itself off because of the plague. Raggett (1982) gives how many of 261 people were
# susceptible and infective at eight times. How contagious was it, how long were people infective, and is the simple
# epidemic a good model of it? This notebook
#
# 1. fits the model by its exact likelihood;
# 2. compares it with another one;
# 3. looks at residuals and at whole runs;
# 4. predicts with the uncertainty of the fit;
# 5. fits events of which the cause was not always seen.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from calibration import Counts, Events, compare_models, fit_model, quantile_residuals
from calibration.estimating.predictive_bands import predictive_bands
from kinetics import Model, Network, predict, sample_path
from kinetics.rates import FittedParameters
from kinetics.support.plots import COLOURS

plt.rcParams.update(
    {"figure.constrained_layout.use": True, "font.size": 9, "axes.prop_cycle": plt.cycler(color=COLOURS)}
)

# %% [markdown]
# ## 1. The table, the model, the fit
#
# A table of counts, a file or a data frame, has a column for the time and one for each species that was counted. Its
# likelihood is that of the Markov chain: the probability of every next row given the row before, summed over all that
# may have happened between.

# %%
table = pd.DataFrame(
    {
        "time": [0, 0.5, 1, 1.5, 2, 2.5, 3, 4],
        "S": [254, 235, 201, 153, 121, 110, 97, 83],
        "I": [7, 14, 22, 29, 20, 8, 8, 0],
    }
)
epidemic = Model(
    Network.from_text(
        """time unit: month
        infect: S + I -> 2 I, beta
        remove: I -> R, alpha""",
        beta=0.02,
        alpha=3.0,
    ),
    {"S": 254, "I": 7},
)
fit = fit_model(Counts().read(epidemic, table), starts=1)
pd.DataFrame({"estimate": fit.fit.value, "95 % from": fit.fit.low, "to": fit.fit.high}, index=list(fit.fit.names))

# %% [markdown]
# The log-likelihood comes with a proven bound.

# %%
print(fit.log_likelihood)

# %% [markdown]
# ## 2. Another model of the same data
#
# Was the mean infective time 10 days? That is alpha = 3 a month, a special case of the model: a likelihood-ratio test.

# %%
held = fit_model(fit.likelihood, ["beta"], fixed={"alpha": 3.0}, starts=1)
pd.DataFrame([vars(row) for row in compare_models({"both free": fit, "alpha = 3": held})])

# %% [markdown]
# ## 3. Is the model right?
#
# A residual is the place of what was seen in the distribution that the model predicts from the row before. Residuals of
# a right model are uniform.

# %%
residuals = quantile_residuals(fit.likelihood, fit.point, seed=1)
print(residuals.verdict)
(band,) = predictive_bands(fit, None, seed=1)
figure, axes = plt.subplots(1, 2, figsize=(9, 3.4))
residuals.plot(axes[0])
band.plot(axes[1])
plt.show()

# %% [markdown]
# ## 4. Predict with what was learned
#
# A second village, of 100 people, of whom 2 are infective: the interval of the mean is the uncertainty of the fit.

# %%
learned = FittedParameters(
    parameters={name: {"value": float(value)} for name, value in zip(fit.fit.names, fit.fit.value, strict=True)},
    covariance_of_logarithms=tuple(map(tuple, fit.fit.covariance.tolist())),
)
village = replace(epidemic, initial=[98, 2, 0])
forecast = predict(village, learned, np.linspace(0, 8, 41), seed=1)
axes = forecast.plot(plt.figure(figsize=(6, 3.2)).gca())
plt.show()

# %% [markdown]
# ## 5. Events whose cause was not always seen
#
# Patients leave a ward because they are cured, or because they are moved. In two of three rows nobody wrote down why.
# The rates of what may have happened add up.

# %%
ward = Model(
    Network.from_text(
        """time unit: day
        cured: P -> 0, k
        moved: P -> 0, l""",
        k=0.2,
        l=0.1,
    ),
    {"P": 60},
)
path = sample_path(ward, None, end=6.0, seed=1)
names = np.where(np.arange(path.times.size) % 3 == 0, np.array(ward.network.channels)[path.channels], "cured; moved")
rows = [
    ("a", 0.0, "start", 60),
    *(("a", t, n, "") for t, n in zip(path.times, names, strict=True)),
    ("a", 6.0, "end", ""),
]
events = pd.DataFrame(rows, columns=["run", "time", "channel", "P"])
causes = fit_model(Events().read(ward, events), ["k", "l"], starts=1)
pd.DataFrame(
    {"truth": [0.2, 0.1], "estimate": causes.fit.value, "95 % from": causes.fit.low, "to": causes.fit.high},
    index=list(causes.fit.names),
)
