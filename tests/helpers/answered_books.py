"""Rule books of answers: what cubes become by what they read, as `book_search` and the oracle of books find them."""

from kinetics.assembly import RuleBook
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal, Semantics


def answered_book(answers, senses, breaks, names, target=None):
    """A book with one rule for each reading; "" is no bond, and a letter that stays needs no rule."""
    combine, dissociate, internal = [], [], []
    for number, (((kind, *seen), (own,), near, *rest), becomes) in enumerate(sorted(answers.items())):
        rule = {"rule": f"{number}", "letter": (own,), "neighbours": near, "becomes": becomes}
        if kind == "break":
            dissociate.append(Dissociation(**rule, lost=rest[0]))
        elif kind == "follow" and becomes != own:
            internal.append(Internal(**rule))
        elif kind == "join" and becomes:
            (face, partner_face, twist), (partner, across, touched) = seen, rest
            more = {
                **({"across": across or ("",)} if senses.across else {}),
                **({"roll": (twist,)} if senses.roll else {}),
                **({"touched": touched} if senses.touched else {}),
            }
            combine.append(Combination(**rule, face=(face,), partner=partner, partner_face=(partner_face,), **more))
    rules = tuple(combine), tuple(dissociate), tuple(internal)
    semantics = Semantics(bonds="break" if breaks else "hold")
    return RuleBook("answers", tuple(names), "a", senses, target, None, semantics, *rules)
