"""Exact widening: its result is sound, maximal and max–min fair; every round blocks a face."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, consts, define, disj, exists, forall, function, implies, neg, sort

FACE = {"f": "Face"}
SPACE = (
    sort("Face"),
    sort("Point"),
    function("reach", ["Face", "Point"], "Real"),
    function("bad", ["Point"], "Bool"),
    function("limit", ["Face"], "Real"),
    function("closed", ["Face"], "Bool"),
)
WITHIN = define(
    "within",
    {"p": "Point", "f": "Face", "l": "Real", "c": "Bool"},
    "Bool",
    "(or (< (reach f p) l) (and c (= (reach f p) l)))",
)
IN_RESULT = forall(FACE, "(within p f (limit f) (closed f))")
IN_OTHER = forall(FACE, "(within p f (other f) (other-closed f))")


STAGE = forall(
    {"g": "Face"},
    implies("(distinct g face)", "(and (within point g (limit g) (closed g)) (<= (reach g point) (limit face)))"),
)
BLOCKS = "a bad point blocks the face: in the box of that round, at most this far out at the other faces"
BLOCKED_BEYOND = "if the face is closed, the point is less than `gain` behind it: there are such points for any gain"
BLOCKED_AT = "if the face is open, the point is not behind it"
RESULT = {
    BLOCKS: conj("(bad point)", "(< 0.0 gain)", STAGE),
    BLOCKED_BEYOND: "(=> (closed face) (< (reach face point) (+ (limit face) gain)))",
    BLOCKED_AT: "(=> (not (closed face)) (<= (reach face point) (limit face)))",
}
VALID = "the other box is valid: no bad point is in it"
OTHER = {VALID: forall({"p": "Point"}, implies("(bad p)", neg(IN_OTHER)))}
MORE = "the other box goes farther at one face"
BEYOND = (
    "(or (<= (+ (limit face) gain) (other face)) (and (= (limit face) (other face)) (other-closed face) (not "
    "(closed face))))"
)
CONTAINS = "the other box contains the result"
DECLARED = (
    *SPACE,
    WITHIN,
    function("other", ["Face"], "Real"),
    function("other-closed", ["Face"], "Bool"),
    *consts("Face", "face", "second"),
    *consts("Point", "point"),
    *consts("Real", "gain"),
)
SHOW = {
    "limit of the first face": "(limit face)",
    "closed": "(closed face)",
    "limit of the second face": "(limit second)",
    "second closed": "(closed second)",
    "the other box at the first": "(other face)",
    "at the second": "(other second)",
    "a bad point reaches at the first": "(reach face point)",
    "and at the second": "(reach second point)",
}
MAXIMAL = Statement(
    DECLARED,
    {
        **RESULT,
        **OTHER,
        CONTAINS: forall(
            FACE, "(or (< (limit f) (other f)) (and (= (limit f) (other f)) (=> (closed f) (other-closed f))))"
        ),
    },
    neg(BEYOND),
    SHOW,
)
FAIR = Statement(
    DECLARED,
    {**RESULT, **OTHER, MORE: BEYOND},
    exists(
        {"g": "Face"},
        conj(
            "(distinct g face)",
            # poorer than it was, and poorer than the face that gained was
            disj("(< (other g) (limit g))", "(and (= (other g) (limit g)) (closed g) (not (other-closed g)))"),
            "(<= (other g) (limit face))",
        ),
    ),
    SHOW,
)
TEXTBOOK = exists({"g": "Face"}, "(and (<= (limit g) (limit face)) (<= (other g) (limit g)) (distinct g face))")
TWO_FACES = "two faces"
ONLY_TWO = conj("(distinct face second)", forall(FACE, "(or (= f face) (= f second))"))
ONE_POINT = forall({"p": "Point"}, "(= p point)")

LEAST = "no bad point has a smaller stretch, over the faces that move, within the faces that stay"
SOUND = Statement(
    (
        *SPACE,
        function("moving", ["Face"], "Bool"),
        *consts("Real", "stretch", "least"),
        *consts("Point", "point"),
        *consts("Face", "face"),
    ),
    {
        LEAST: forall(
            {"p": "Point"},
            implies(
                conj("(bad p)", forall(FACE, "(=> (not (moving f)) (<= (reach f p) (limit f)))")),
                exists(FACE, "(and (moving f) (<= least (reach f p)))"),
            ),
        ),
        "the box: faces that move are short of the least stretch": "(< stretch least)",
        "a point in the box": forall(FACE, "(<= (reach f point) (ite (moving f) stretch (limit f)))"),
    },
    "(not (bad point))",
    {"least stretch": "least", "stretch of the box": "stretch", "reach of the point": "(reach face point)"},
)
LEAST_NEAR = "the least stretch is one: a bad point is nearer to it than any room that is given"
ROUND = Statement(
    (
        *SPACE,
        function("moving", ["Face"], "Bool"),
        *consts("Real", "least", "room"),
        *consts("Face", "face"),
        *consts("Point", "point"),
    ),
    {
        LEAST_NEAR: conj("(bad point)", forall(FACE, "(<= (reach f point) (ite (moving f) (+ least room) (limit f)))")),
        "some room": "(< 0.0 room)",
    },
    neg(
        forall(
            {"p": "Point"},
            implies(forall(FACE, "(<= (reach f p) (ite (moving f) (+ least room) (limit f)))"), "(not (bad p))"),
        )
    ),
    {"room": "room", "least stretch": "least"},
)

THEOREM = Theorem(
    name="exact_widening",
    title="Exact widening is sound, maximal and max–min fair",
    source="ours",
    words="Moving all faces outwards at the speed of their weights, and freezing those that bad values block, "
    "gives a box "
    "without bad values that no valid box contains, with open and closed ends known. It is max–min fair: a valid "
    "box that "
    "goes farther at one face pays with another face that ends up poorer than it was and no farther out than the first "
    "face was. At least one face is frozen in each round, so there are at most 2n rounds.",
    formalisation="`Face` and `Point` are arbitrary sets (two faces per parameter, points are parameter values); "
    "`reach` is "
    "how far a point lies beyond the nominal one in a face's direction, in units of the weight; `limit` and "
    "`closed` are the "
    "result. A face is frozen because of bad points that lie within the box of that round, at its stretch; that is "
    "what "
    "the two assumptions on the result say.",
    scope=Scope.GENERAL,
    bound="any number of parameters, any bad set.",
    lemmas=(
        Lemma(
            "sound",
            "A box whose moving faces are short of the least stretch at which bad values are met has none.",
            SOUND,
            (
                Variant(
                    "the box goes as far as the least stretch, as a closed box: the bad value there is in it.",
                    SOUND.with_changed("the box: faces that move are short of the least stretch", "(<= stretch least)")
                    .with_also("one face, which moves", forall(FACE, "(and (= f face) (moving f))"))
                    .with_also("one point", ONE_POINT),
                ),
            ),
        ),
        Lemma(
            "maximal",
            "No valid box contains the result, unless it is the result.",
            MAXIMAL,
            (
                Variant(
                    "a closed face may be frozen without reason.",
                    MAXIMAL.without(BLOCKED_BEYOND).with_also(TWO_FACES, ONLY_TWO).with_also("one point", ONE_POINT),
                ),
                Variant(
                    "an open face may be frozen without reason.",
                    MAXIMAL.without(BLOCKED_AT, BLOCKED_BEYOND)
                    .with_also(
                        "all ends open, the other box closed", forall(FACE, "(and (not (closed f)) (other-closed f))")
                    )
                    .with_also(TWO_FACES, ONLY_TWO)
                    .with_also("one point", ONE_POINT),
                ),
                Variant(
                    "the other box need not be valid.",
                    MAXIMAL.without(VALID)
                    .with_also("all ends open", forall(FACE, "(not (closed f))"))
                    .with_also(TWO_FACES, ONLY_TWO)
                    .with_also("one point", ONE_POINT),
                ),
            ),
            interesting="(and (closed face) (distinct face second) (not (closed second)) "
            "(< (limit face) (limit second)))",
        ),
        Lemma(
            "fair",
            "A valid box that goes farther at one face has another face that lost, and that is now no farther out "
            "than the "
            "first face was.",
            FAIR,
            (
                Variant(
                    "the other box need not be valid.",
                    FAIR.without(VALID)
                    .with_also("all ends open", forall(FACE, "(not (closed f))"))
                    .with_also(TWO_FACES, ONLY_TWO)
                    .with_also("one point", ONE_POINT),
                ),
                Variant(
                    "the textbook's form for convex sets, in which a face pays that had no more than the first: a "
                    "face that "
                    "had more can pay as well, by falling below the first.",
                    FAIR.claiming(TEXTBOOK)
                    .with_also(TWO_FACES, ONLY_TWO)
                    .with_also("all ends of the result open", forall(FACE, "(not (closed f))"))
                    .with_also("the second face went farther", "(and (= (limit face) 1.0) (= (limit second) 5.0))"),
                ),
            ),
        ),
        Lemma(
            "round",
            "At the least stretch, not all faces that move can go on together: each round freezes one at least.",
            ROUND,
            (Variant("bad points come no nearer than some distance: all faces may go on.", ROUND.without(LEAST_NEAR)),),
        ),
    ),
)
