"""First-passage times with the uncertainty of the rates."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from kinetics.markov import first_passage
from kinetics.markov.passage import Passage
from kinetics.network import Model, Network
from kinetics.network.sums import Counted
from kinetics.predicting.over_draws import LIMITS
from kinetics.predicting.prediction import evidence_notes
from kinetics.rates.applied import AppliedRates
from kinetics.support.answer import CONFIDENCE, Answer
from kinetics.support.arrays import Counts, whole_number
from kinetics.support.cli.progress import stage
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import counted, in_unit


@dataclass(frozen=True, eq=False, repr=False)
class PassagePrediction(Shown):
    """A first-passage time under rates that are known from evidence, or taken as known; times in tu.

    passage : its distribution at the posterior mean of each rate constant, or at the rates that are taken as known
    mean : the mean of `passage`, with its bounds; if rates have evidence, the posterior median of the mean time and
        its middle 95 %
    notes : remarks for the reader
    network : the network whose passage it is, with its rate constants

    The mean time has no posterior mean where a rate has few events: 1 / k has none with k from Gamma(1/2). Its median
    and quantiles exist always; they are inf only if the target may be missed at any rates.

    >>> from kinetics import Network, predict_passage
    >>> found = predict_passage(Network.from_text("A -> B, 0.1"), None, {"A": 1}, "B")
    >>> round(found.mean.value, 9), found.mean.kind  # rate constants taken as exact (no uncertainty given)
    (10.0, 'proven')
    """

    passage: Passage
    mean: Answer
    notes: tuple[str, ...]
    network: Network

    @property
    def headline(self) -> str:
        """One line: the mean time, with the interval from the rates."""
        mean = in_unit(f"{self.mean.value:.4g}", self.passage.time_unit)
        known = f" [{self.mean.low:.4g}, {self.mean.high:.4g}], 95 % from the rates"
        return f"time until {self.passage.target}: mean {mean}{known if self.mean.kind == CONFIDENCE else ''}"

    def summary(self) -> ResultTable:
        """The distribution of the time, under its headline and notes."""
        table = self.passage.summary()
        return ResultTable(self.headline, table.titles, table.rows, (*table.notes, *self.notes))


def predict_passage(
    model: Model | Network,
    rates: AppliedRates | None,
    initial: Counts | None,
    species: Counted,
    copies: int = 1,
    seed: int = 0,
    draws: int = 100,
) -> PassagePrediction:
    """First passage to `copies` of a species, and what the uncertainty of the rates leaves open of its mean.

    rates : None for the model's own, which are taken as known, so that there is no interval
    initial : counts at time 0 that go before the model's; None for these
    draws : number of draws of the rates; each is solved exactly, so the cost is so many solutions
    ValueError: rates of another network or without their tank, and what `first_passage` refuses

    >>> from kinetics import ChannelRate, Convention, Network, Rates, predict_passage
    >>> decay = Network.from_text("decay: A -> B, 1")
    >>> measured = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    >>> found = predict_passage(decay, rates, {"A": 1}, "B", seed=1)
    >>> found.mean.low < 10.0 < found.mean.high, round(found.passage.mean, 4)  # of the mean rate, 40.5 / 400
    (True, 9.8765)
    """
    given = Model.of(model, initial)
    network, start = given.network, given.initial
    if rates is None or not rates.has_evidence:
        network = network if rates is None else rates.apply(network, given.tank)
        passage = first_passage(network, start, species, copies)
        return PassagePrediction(passage, passage.answer("mean"), evidence_notes(rates), network)
    began, posterior = time.process_time(), rates.posterior(network, given.tank)
    sequence = np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=(1, 0))
    table = posterior.draw(np.random.default_rng(sequence), whole_number("draws", draws, 2))
    means = []
    for number, each in enumerate(posterior.networks(table)):
        stage(f"{number} of {draws} draws of the rates", number / draws)
        means.append(first_passage(each, start, species, copies).mean)
    # No interpolation between a finite mean and an infinite one.
    low, median, high = np.quantile(means, (LIMITS[0], 0.5, LIMITS[1]), method="inverted_cdf").tolist()
    notes = (
        "the mean is the posterior median of the mean time (which may have no posterior mean), with the middle 95 %",
        "sd, quantiles and curve are those at the posterior mean of each rate constant",
    )
    passage = first_passage(posterior.expected, start, species, copies)
    cost, size = time.process_time() - began, counted(draws, "draw")
    mean = Answer(median, low, high, CONFIDENCE, "draws of the rates", cost, size)
    return PassagePrediction(passage, mean, (*evidence_notes(rates), *notes), posterior.expected)
