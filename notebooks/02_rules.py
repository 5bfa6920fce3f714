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
# # Rules for a shape
#
# You want cubes that meet by chance to build a T, and nothing else. A cube knows only what it can sense: the face that
# it touches, and the states of its neighbours. Which cubes may bond, how little must each know, and how many Ts come
# out of sixty cubes?
#
# A *rule book* answers the first question: it says which cubes may bond, and how their letters (their states) change
# when they do. The same book drives the mechanics and gives the reaction network, so it must be correct. This notebook
#
# 1. reads a book and draws what it does;
# 2. **checks** it: is it closed, does everything lead to the target, can the tank get stuck?
# 3. shows what is wrong with the tables **as printed**;
# 4. **compiles** a book from nothing but a target shape;
# 5. **ranks** correct books by how fast, and how completely, their tanks assemble;
# 6. grows a structure whose network is too large to write down, and the 45 cubes of a pyramid from a seed.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from kinetics import ClassRates, grow, rank
from kinetics.assembly import RuleBook, Senses, check, derive
from kinetics.assembly.compiler import InfeasibleError, Target, compile_book
from kinetics.assembly.deriving.history import random_growth
from kinetics.assembly.drawing.pictures import strip
from kinetics.assembly.rules.conditions import Combination

plt.rcParams.update({"figure.constrained_layout.use": True, "font.size": 9})

# %% [markdown]
# ## 1. A book and its network
#
# The T of five cubes: a bar of three, and a stem of two on the bar's middle cube. Cubes distinguish top and bottom (f1)
# from their four sides (f2), and read the letters of the cubes to which they are bonded.

# %%
book = RuleBook.load("t5")
fig, ax = plt.subplots(figsize=(7, 4))
book.plot(ax)

# %% [markdown]
# `derive` tries every way to join any two structures, and to break any bond, until nothing new appears. The list is
# therefore complete: nine structures, each a part of the T. The numbers are the multiplicities *N*, counted from
# geometry.

# %%
derivation = derive(book)
fig, ax = plt.subplots(figsize=(10, 4))
derivation.plot(ax)
derivation.is_closed, derivation.network

# %% [markdown]
# Channels that join (or break) the same faces of structures of the same sizes share one rate constant. These classes
# are what a calibration has to measure, and they apply to other books, too.

# %%
[str(rate_class) for rate_class in derivation.rate_classes]

# %% [markdown]
# ## 2. Checked
#
# The checker explores the book exhaustively, also with internal rules that are slower than the next collision. For the
# T it finds no fault. The line of four is correct as long as its internal rule is fast, and the checker says so.

# %%
print(check(book))
print(check(RuleBook.load("line4")))

# %% [markdown]
# ## 3. As printed
#
# Even in its most favourable reading, the paper's Table I lets two trimers join: P2 does not check to which cube the
# cube is bonded. Each finding comes with the shortest path to it.

# %%
report = check(RuleBook.load("line4_as_printed"), max_cubes=6)
fig, ax = plt.subplots(figsize=(7, 3))
report.findings[0].plot(ax)
[finding.kind for finding in report.findings]

# %% [markdown]
# ## 4. Compiled
#
# The paper leaves the synthesis of rules from a shape to future work. For small shapes the compiler searches all
# labellings with few letters, and verifies each book that it returns by exhaustive exploration. The paper's T takes
# four letters (and has no rules for breaking); two are enough, with breaking, if a bar bonds with a dimer.

# %%
compiled = compile_book(Target.load("t5"))
print(f"{compiled.letters} letters, proven the fewest of their kind: {compiled.minimal}; {compiled.capability}")
print(*compiled.searched, *compiled.verified, sep="\n")
fig, ax = plt.subplots(figsize=(7, 4))
compiled.book.plot(ax)

# %% [markdown]
# What cubes can sense decides what they can build. For a plate of two by two a cube must sense more than the face and
# the letter opposite; with less, the compiler says which two situations look the same.

# %%
plate = Target.load("plate2x2")
made = compile_book(plate)
print(f"{made.letters} letters with {made.capability}")
try:
    compile_book(replace(plate, senses=Senses(faces="two", roll=True)))
except InfeasibleError as error:
    print(error)

# %% [markdown]
# ## 5. Ranked by kinetics
#
# All of these books are correct: each builds its target and nothing else. They differ in the joins they allow. For the
# T, joining a bar with a dimer does better than the paper's pathway; allowing every join ruins the yield, because cubes
# then get stuck in incomplete Ts that no longer fit together. Here all faces have the same rates.

# %%
books = [RuleBook.load(name) for name in ("t5", "t5_bar", "t5_all")]
choice = rank(books, ClassRates.uniform(join=7e-5, break_=3e-5), cubes=60, horizon=2000, runs=200, seed=1)
print(choice.table())
fig, ax = plt.subplots(figsize=(5, 3.5))
choice.plot(ax)

# %% [markdown]
# ## 6. Beyond what can be enumerated
#
# Cubes that stick at every face make 166 structures of six cubes and 1,023 of seven: the network of sixty cubes cannot
# be enumerated. The same rules run without a network: faces meet at random, and joins that the rules refuse do not
# happen.

# %%
sticky = RuleBook(
    name="sticky",
    letters=("s",),
    initial="s",
    senses=Senses(faces="one"),
    combine=(Combination(rule="stick", becomes="s"),),
)
tank = grow(sticky, ClassRates.uniform(join=4e-6), 60, 400.0, runs=10, seed=1)
fig, ax = plt.subplots(figsize=(6, 3.5))
tank.plot(ax, np.linspace(0, 400, 101))

# %% [markdown]
# The pyramid of 45 cubes is grown from a seed. Its rules allow only one stage at a time; a wave of state updates tells
# the seed that a layer is complete.

# %%
pyramid = RuleBook.load("pyramid45")
frames = random_growth(pyramid, seed=1)
some = [frames[k] for k in (0, 8, 20, 24, 26, 34, 42, 44)]
fig, ax = plt.subplots(figsize=(8, 7))
strip(some, [f"{len(structure)} cubes" for structure in some]).onto(ax)

# %%
grown = grow(pyramid, ClassRates.uniform(join=7e-5), 200, 1200.0, runs=20, seed=1)
times = grown.first_times(pyramid.target)
print(f"{np.isfinite(times).sum()} of 20 pyramids complete, after {np.nanmean(times):.0f} tu in the mean")
fig, ax = plt.subplots(figsize=(6, 3.5))
grown.plot(ax, np.linspace(0, 1200, 101))
