"""What the checker claims of a book, held against small tanks in which everything was tried; both ways."""

from collections import Counter

from kinetics.assembly.checking.checker import SLOW, report_of
from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.deriving.explore import explore
from tests.helpers.brute_tanks import BruteBook, BruteTank, marked
from tests.helpers.mutated_books import mutated
from tests.helpers.planted_faults import FAULTS, planted
from tests.helpers.random_books import random_book

MOST_STATES = 100
MOST_CUBES = 6
MOST_STRUCTURES = 24
MOST_IN_WAVES = 12  # structures at rest, of books whose slow waves are followed


def drawn(seed):
    """A book, by turns without any plan, a right one that was changed, changed again, and with a planted fault."""
    if seed % 4 == 0:
        return random_book(seed)
    if seed % 4 < 3:
        return mutated(seed)
    fault = sorted(FAULTS)[seed // 4 % len(FAULTS)]
    return planted(fault, seed)[1]


def claims_of(seed):
    """What was claimed of the book that is drawn, counted; nothing where there is none."""
    book = drawn(seed)
    return Counter() if book is None else compared(book, 2 * MOST_STRUCTURES if seed % 4 == 3 else MOST_STRUCTURES)


def compared(book, most=2 * MOST_STRUCTURES):
    """Counts of what was claimed of a book and found true; AssertionError where a claim is false or a fault was missed.

    Each finding's steps are repeated by the brute force, and its end is looked at. A tank of one target's cubes is
    searched for lost cubes (one is marked), larger ones, to two targets' cubes, for starvation and what forms.
    """
    index = ExplorationIndex(explore(book, MOST_CUBES, most))
    has_waves = bool(book.internal) and index.found.is_closed and len(index.found.structures) <= MOST_IN_WAVES
    report = report_of(index, slow_waves=has_waves)
    said = Counter(["books", "correct" if report.is_correct else "faulty"])
    brute, slow = BruteBook(book), BruteBook(book, slow=True)
    for finding in report.findings:
        said[finding.kind] += 1
        _holds(finding, slow if finding.kind.startswith(SLOW) else brute, said)
    said += _seen(index, report, brute)
    if has_waves:
        said += _seen_in_waves(index, report, slow)
    return said


def _holds(finding, brute, said):
    """Repeat a finding's steps."""
    name = f"{brute.book.name}: {finding}"
    for before, after in finding.changes:
        if sum(map(len, after)) > MOST_CUBES:
            continue  # growth beyond the caps
        old, new = (tuple(sorted(map(brute.number, side))) for side in (before, after))
        made = brute.alone(*old) if len(old) == 1 else {(n,) for n in brute.together(*old)}
        assert new in made, f"{name}: {before} never become {after}"
        said["steps repeated"] += 1
        last = (old, new)
    kind = finding.kind.removeprefix(SLOW)
    if kind == "off-target":
        assert not brute.is_part(brute.number(finding.structure)), name
    elif kind == "target not final":
        assert any(map(brute.is_target, last[0])), name
        assert len(last[0]) == 2, name
    elif kind == "squeezed":
        assert (last[0], last[1][0]) in brute.squeezing, name
    elif kind == "dead end":
        assert not brute.alone(brute.number(finding.structure)), name


def _seen(index, report, brute):
    """What forms, and tanks of free cubes, everything tried."""
    book, found, said = brute.book, index.found, Counter()
    forms = _forms(index, report, brute)
    if not found.is_closed or not index.targets:
        return said
    said["cubes called lost"], said["cubes not called lost"] = _lost(index, brute)
    if report.recoverability.proven == "enough free cubes":
        said["finished with enough cubes"] += sum(_is_finished(brute, number) for number in forms)
    starving = [finding for finding in report.findings if finding.kind == "starvation"]
    size = len(book.target)
    for cubes in [size] if book.seed_letter is not None else range(size, 2 * size + 1):
        tank = BruteTank.of_free_cubes(brute, cubes, most=MOST_STATES)
        if not tank.is_complete:
            break
        said["tanks searched"] += 1
        can_starve, must_starve = tank.starves()
        where = f"{book.name}: a tank of {cubes} starves: {can_starve}, for certain: {must_starve}"
        if report.recoverability.proven == "any tank":
            assert not can_starve, where
            said["tanks proven not to starve"] += 1
        if starving and cubes == report.recoverability.searched[-1]:
            assert can_starve, where
            assert starving[0].is_error == must_starve, where
            said["starving tanks"] += 1
        elif cubes in report.recoverability.searched:
            assert not can_starve, where
            said["tanks said not to starve"] += 1
        assert starving or not can_starve or not report.is_correct, where
    return said


def _forms(index, report, brute):
    """All structures that form; every one is known, and what they show is said."""
    found, name = index.found, brute.book.name
    caps = (MOST_CUBES, len(found.structures)) if found.is_closed else (4, 8)
    forms, _ = brute.forms(*caps)
    kinds = {finding.kind for finding in report.findings}
    if found.is_closed:
        assert forms == set(map(brute.number, found.structures)), f"{name}: other structures form"
        assert not brute.restless, f"{name}: livelock was missed"
        assert bool(brute.squeezing) == ("squeezed" in kinds), f"{name}: squeezed was missed"
        assert bool(forms & brute.targets) == ("target not reached" not in kinds), f"{name}: target"
        grows = any(brute.together(m, n) for m in forms & brute.targets for n in forms)
        assert grows == ("target not final" in kinds), f"{name}: target not final was missed"
        assert all(map(brute.is_part, forms)) == ("off-target" not in kinds), f"{name}: off-target was missed"
    else:
        assert not report.is_correct, name
        assert report.recoverability[:2] == ("nothing", ()), f"{name}: something is claimed where not all is known"
        assert "target not reached" not in kinds, name
    return forms


def _lost(index, brute):
    """How many cubes that are called lost never come home, and how many others do; all must, where it can be tried."""
    book, found, numbers = brute.book, index.found, [0, 0]
    claimed = {marked(found.structures[c.structure], c.number).canonical(book.scheme) for c in index.lost}
    tank = BruteTank.of_free_cubes(brute, len(book.target), follow=True, most=MOST_STATES)
    if not tank.is_complete:
        return numbers
    seen, home = tank.homeless()
    assert claimed.isdisjoint(home), f"{book.name}: a cube called lost comes home"
    for one in seen - home - claimed:  # it takes more cubes
        assert _comes_home(brute, one), f"{book.name}: a lost cube was missed in {one}"
    return [len(claimed & seen), len(seen - claimed)]


def _comes_home(brute, one):
    """Whether the marked cube of a structure gets into a target with free cubes and a seed around; True if too many."""
    more = [cube for cube in (brute.book.seed(),) if cube is not None]
    for cubes in range(1, 2 * len(brute.book.target) + 1):
        tank = BruteTank(brute, [one, *more, *[brute.book.monomer()] * cubes], MOST_STATES)
        if not tank.is_complete or tank.has_state(lambda state: any(map(brute.is_marked_target, state))):
            return True
    return False


def _is_finished(brute, number):
    """Whether a structure can become targets and free cubes alone with some free cubes around; True if too many."""
    done = {*brute.targets, brute.number(brute.book.monomer())}
    for cubes in range(2 * len(brute.book.target) + 1):
        tank = BruteTank(brute, [brute.structures[number], *[brute.book.monomer()] * cubes], MOST_STATES)
        if not tank.is_complete or tank.has_state(done.issuperset):
            return True
    raise AssertionError(f"{brute.book.name}: {brute.structures[number]} is not finished")


def _seen_in_waves(index, report, slow):
    """The same while internal rules act one cube at a time."""
    kinds = {finding.kind.removeprefix(SLOW) for finding in report.findings}
    forms, _ = slow.forms(len(slow.book.target) + 1, MOST_STRUCTURES)
    name = f"{slow.book.name} in slow waves"
    if index.targets and not all(map(slow.is_part, forms)):
        assert "off-target" in kinds, f"{name}: off-target was missed"
    if slow.squeezing and "squeezed" not in kinds:
        raise AssertionError(f"{name}: squeezed was missed")
    tank = BruteTank.of_free_cubes(slow, len(slow.book.target), most=MOST_STATES)
    if index.targets and tank.is_complete and tank.starves()[0] and report.is_correct:
        faults = {"starvation", "trap", "dead end", "livelock", "not closed", "not proven", "target not reached"}
        assert kinds & faults, f"{name}: starvation was missed"
    return Counter(["books with waves"])
