"""[PIKE] §5.7: how prime implicants answer whether constraints could be added; as printed, the answer can be wrong."""

from proofs.theorems._library.environments import Universe, entails, member, text, union
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import Term, all_of, any_of, conj, exactly_one, iff, implies, neg

UNIVERSE = Universe((2, 2, 3))
ALL = UNIVERSE.environments


def without_conflict(environment: tuple[int, ...]) -> Term:
    """The environment manifests none of the new conflicts."""
    return neg(UNIVERSE.holds_some("conflict", environment))


def joined(reach: Term | None = None) -> Term:
    """Some environment of the label joins the new assignments without manifesting a conflict.

    `reach` None: as printed. Otherwise some scenario that extends the join resolves all conflicts.
    """
    found = []
    for e in ALL:
        for a in ALL:
            both = union(e, a)
            if both is None:
                continue
            ends = (
                [without_conflict(both)]
                if reach is None
                else [any_of(without_conflict(s) for s in UNIVERSE.scenarios if entails(s, both))]
            )
            found.append(conj(member("label", e), member("assigned", a), *ends))
    return any_of(found)


POSSIBLE = any_of(
    conj(UNIVERSE.holds_some("label", s), UNIVERSE.holds_some("assigned", s), without_conflict(s))
    for s in UNIVERSE.scenarios
)
ONE_ASSIGNED = "the new assignments are one environment"
ONE_CONFLICT = "there is one new conflict at most, which is not empty"
STATEMENT = Statement(
    (*UNIVERSE.set_of("label"), *UNIVERSE.set_of("assigned"), *UNIVERSE.set_of("conflict")),
    {ONE_ASSIGNED: exactly_one([member("assigned", a) for a in ALL])},
    iff(joined("scenario"), POSSIBLE),
    {
        f"{kind} {text(e)}": member(name, e)
        for name, kind in (("label", "implicant"), ("assigned", "assigned"), ("conflict", "conflict"))
        for e in ALL
        if sum(map(bool, e)) <= 1
    },
)
SINGLE = Statement(
    STATEMENT.declarations,
    {
        **STATEMENT.assumptions,
        ONE_CONFLICT: conj(
            all_of(
                neg(conj(member("conflict", e), member("conflict", f)))
                for index, e in enumerate(ALL)
                for f in ALL[index + 1 :]
            ),
            neg(member("conflict", (0, 0, 0))),
        ),
    },
    iff(joined(), POSSIBLE),
    STATEMENT.show,
)
EXAMPLE = conj(
    *(member("label", e) if e == (0, 0, 0) else neg(member("label", e)) for e in ALL),
    member("assigned", (0, 0, 0)),
    *(member("conflict", e) if e in ((1, 0, 0), (2, 0, 0)) else neg(member("conflict", e)) for e in ALL),
)

THEOREM = Theorem(
    name="pike_could_commit",
    title="Whether constraints could be added",
    source="[PIKE, §5.7]",
    words="Constraints can be added to the theory exactly if some environment of the goal's label joins the new "
    "assignments and "
    "has a completion that avoids all new conflicts. That it manifests none of the conflicts, as printed, is "
    "enough for one "
    "conflict; with several, each may be avoidable and all together not.",
    formalisation="The label, the assignments and the conflicts are arbitrary sets of environments, one truth "
    "value each. Possible "
    "is what Definition says: some scenario satisfies the label and the assignments and manifests no conflict.",
    scope=Scope.BOUNDED,
    bound="all labels, assignments and sets of conflicts over three variables with 2, 2 and 3 values.",
    lemmas=(
        Lemma(
            "completion",
            "A label's environment with a completion that avoids all conflicts exists exactly if adding is possible.",
            STATEMENT,
            (
                Variant(
                    "no environment of the label is looked at, only the assignments.",
                    STATEMENT.claiming(
                        implies(
                            any_of(
                                conj(member("assigned", a), without_conflict(s))
                                for a in ALL
                                for s in UNIVERSE.scenarios
                                if entails(s, a)
                            ),
                            POSSIBLE,
                        )
                    ),
                ),
            ),
            (
                Variant(
                    '"does not manifest any of the new conflicts": a label whose only environment is empty, with '
                    "the new conflicts {x=1} and {x=2} of a "
                    "variable with two values manifests neither; no scenario avoids both. Repair: look for a "
                    "completion.",
                    STATEMENT.claiming(implies(joined(), POSSIBLE)).with_also("the example", EXAMPLE),
                ),
            ),
        ),
        Lemma(
            "one conflict",
            "With one new conflict, not manifesting it is enough.",
            SINGLE,
            (Variant("there may be several conflicts.", SINGLE.without(ONE_CONFLICT)),),
        ),
    ),
)
