"""Whether a tank, whatever has happened in it, can still assemble all the targets that its cubes would make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinetics.assembly.checking.compositions import MAX_COMPOSITIONS, compositions, events_to, leading_to
from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.checking.findings import Finding, Recoverability
from kinetics.assembly.checking.recoverability import scope
from kinetics.assembly.deriving.explore import Indices, StructureEvent

Tank = Mapping[Indices, Sequence[tuple[StructureEvent, Indices]]]


def in_tanks(index: ExplorationIndex) -> tuple[Recoverability, list[Finding]]:
    """The tanks in which all cubes can still end in targets, and the smallest tank that can starve.

    Tanks from one target's cubes to two targets' are searched if there is no proof for all of them.
    """
    found, targets = index.found, index.targets
    if not targets or not found.is_closed:
        return Recoverability(
            "nothing", (), "not examined, because there is no target, or structures grow without bound"
        ), []
    if index.lost:
        return Recoverability("nothing", (), "no: some cubes never become part of a target"), []
    size, seeded = len(found.structures[min(targets)]), index.seed is not None

    def is_makeable() -> bool:
        tank = compositions(_start(size, seeded), found.events, index.progress, until=targets)
        return tank is not None and any(not targets.isdisjoint(state) for state in tank)

    proven = scope(found, index.seed, targets, is_makeable)
    if proven == "any tank":
        parts = "free cubes and the seed" if seeded else "free cubes"
        text = (
            f"proven for any number of cubes: every other structure can fall apart into {parts}, which make the target"
        )
        return Recoverability(proven, (), text), []
    tried: list[int] = []
    findings: list[Finding] = []
    for cubes in [size] if seeded else range(size, 2 * size + 1):
        start = _start(cubes, seeded)
        tank = compositions(start, found.events, index.progress)
        if tank is None:
            text = f"starvation: {cubes} cubes come in more than {MAX_COMPOSITIONS} compositions"
            findings.append(Finding("not proven", False, text))
            break
        tried.append(cubes)
        full = 1 if seeded else cubes // size
        starving = _starving(index, tank, start, full)
        if starving is not None:
            findings.append(starving)
            break
    tanks = f"tanks of {size} to {tried[-1]} cubes" if len(tried) > 1 else f"tanks of {size} cubes"
    starved = [finding for finding in findings if finding.kind == "starvation"]
    shown = (
        "none of which starves"
        if not starved
        else "the last of which never holds all its targets"
        if starved[0].is_error
        else ("the last of which can starve")
    )
    text = f"searched: {tanks}, {shown}" if tried else "no tank could be searched"
    if proven == "enough free cubes":
        text += "; proven for every structure that has free cubes enough around it"
    return Recoverability(proven, tuple(tried), text), findings


def _start(cubes: int, seeded: bool) -> Indices:
    return (*(0,) * (cubes - 1), 1) if seeded else (0,) * cubes


def _starving(index: ExplorationIndex, tank: Tank, start: Indices, full: int) -> Finding | None:
    """The nearest composition from which the tank no longer gets full: an error where it never does."""

    def n_targets(state: Indices) -> int:
        return sum(structure in index.targets for structure in state)

    sources: dict[Indices, set[Indices]] = {state: set() for state in tank}
    for state, following in tank.items():
        for _, after in following:
            sources[after].add(state)
    good = leading_to([state for state in tank if n_targets(state) >= full], sources)
    bad = [state for state in tank if state not in good]  # in the order of distance
    if not bad:
        return None
    stuck = next((state for state in bad if not tank[state]), bad[0])
    contents = " + ".join(index.names[n] for n in stuck)
    what = "where nothing happens any more" if not tank[stuck] else "from which no target can be reached"
    is_certain = tuple(sorted(start)) not in good
    if is_certain:
        text = f"{len(start)} cubes never make {full} target{'s' if full > 1 else ''}, whatever happens"
    else:
        text = f"{len(start)} cubes can end as {contents}, {what}: {n_targets(stuck)} targets instead of {full}"
    steps, changes = index.as_steps(events_to(stuck, start, tank))
    return Finding("starvation", is_certain, text, steps, changes=changes)
