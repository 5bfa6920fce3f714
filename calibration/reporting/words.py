"""Readable names for the columns of tables in reports; CSV and JSON keep the short names."""

from __future__ import annotations

IN_WORDS = {
    # rates
    "exposure": "exposure (combinations × time)",
    "ways": "multiplicity N",
    "rate": "rate k",
    "low": "95 % from",
    "high": "95 % to",
    # break models
    "is_chosen": "chosen",
    "log_likelihood": "log-likelihood",
    "aic_above_least": "AIC above the smallest",
    "aic_by_partner": "AIC by partner, above the smallest",
    "p_against_nested": "p of the simpler model",
    "log_score": "log score of runs left out",
    "freedom": "degrees of freedom",
    "p_deviance": "p of the deviance",
    # fitted parameters
    "n_free": "free parameters",
    "p_ratio": "p of the likelihood-ratio test",
    "p_uniform": "p of the distribution",
    "p_middle": "p of the mean",
    "p_spread": "p of the spread",
    "p_order": "p of neighbours",
    # coarse looks
    "fall": "relative fall of the propensity between two looks",
    "bias": "relative error of the rate, about",
    "corrected": "rate without it, about",
    "per_look": "events between two looks",
    # rules of a plan
    "came": "result",
    "is_kept": "verdict",
    # events
    "scatter": "scatter (1 if Poisson)",
    "scatter_low": "95 % of scatters from",
    "scatter_high": "95 % of scatters to",
    "p_scatter": "p of the scatter",
    # validation, one row each
    "is_consistent": "consistent",
    "coverage": "times inside the band of the mean",
    "coverage_low": "95 % of such shares from",
    "coverage_high": "95 % of such shares to",
    "run_coverage": "single runs inside their band",
    "run_coverage_low": "95 % of shares of runs from",
    "run_coverage_high": "95 % of shares of runs to",
    "misfit": "misfit of the means",
    "p_misfit": "p of the misfit",
    "crps": "continuous ranked probability score",
    "crps_floor": "score expected if the prediction holds",
    "p_crps": "p of the score",
    "p_single_runs": "p of single runs (PIT)",
    "p_joins": "p of the number of joins",
    "p_breaks": "p of the number of breaks",
    "p_scatter_joins": "p of the scatter of joins",
    "p_scatter_breaks": "p of the scatter of breaks",
    "first_observed": "first target, mean, runs cut at their end (tu)",
    "first_low": "95 % of that mean from (tu)",
    "first_high": "95 % of that mean to (tu)",
    "first_censored": "runs without a target",
    "first_predicted": "first target, predicted mean, cut alike (tu)",
    "first_predicted_error": "standard error of that prediction (tu)",
    "first_mean": "first target, predicted mean, uncut (tu)",
    "first_sd": "standard deviation of that (tu)",
    "p_first": "p of the first targets",
    "cpu_mechanics_s": "CPU time of the mechanics (s)",
    "cpu_ssa_s": "CPU time of the SSA runs (s)",
    "ssa_runs": "SSA runs",
    "cpu_exact_s": "CPU time of the exact solution (s)",
}


def in_words(column: str) -> str:
    """The name of a column for readers."""
    return IN_WORDS.get(column, column.replace("_", " "))
