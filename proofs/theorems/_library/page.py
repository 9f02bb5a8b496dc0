"""The page of theorems in the manual, written after a run in which everything was as stated."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from proofs.theorems._library.model import Kind, Lemma, Scope, Theorem, Variant, problems

HEAD = """# Theorems

What the methods of this tool rest on, stated as SMT problems and decided by two solvers. `python -m proofs` checks all
of it and writes this page with `--write-docs`; `--smt2 DIR` writes the problems for any other solver. [IRR] and [PIKE]
are the papers that the tool implements; *ours* are its own methods.

Each problem negates a claim; both solvers, z3 and cvc5, say `unsat`. Constants and functions in a problem are
arbitrary, so *general* means any number of events, parameters or values. *General, by induction* means the same, of
statements that need an induction: the solvers decide its start and its step, and that start and step make a proof is
argued in words, with what else is. *Bounded* means all structures up to the size given. Beside each claim stand its
assumptions alone (both solvers say `sat`: the claim is not empty; `--models` shows a model), and variants that we broke
on purpose (both say `sat`: the claim needs what it assumes). Where a statement does not hold as printed, its
countermodel is found in the same way, and what is proved is the repaired statement. Time limits are of processor time,
so that a busy machine finds what an idle one finds.

What this does not show: that the formalisation says what the words say (read it: one file per theorem in
`proofs/theorems/`), and that the tool's code does what the theorems are about (the tests are for that).

"""


def page(theorems: Sequence[Theorem]) -> str:
    """The whole page: a table, then each theorem; without times, which differ from run to run."""
    theorems = sorted(theorems, key=_by_source)
    lines = ["| theorem | source | scope | z3 | cvc5 | broken variants | as printed |", "|---|---|---|---|---|---|---|"]
    lines += [_row(theorem) for theorem in theorems]
    return HEAD + "\n".join([*lines, "", *_scopes(theorems)]) + "\n" + "".join(_section(one) for one in theorems)


def _scopes(theorems: Sequence[Theorem]) -> Iterator[str]:
    """What is general, what is bounded, and what is taken from elsewhere."""
    yield "What the solvers decide of each theorem that is not simply general, or rests on others of the list:\n"
    yield "| theorem | scope | bound, or that of before | rests on |"
    yield "|---|---|---|---|"
    for theorem in theorems:
        cited = dict.fromkeys(result.theorem for lemma in theorem.lemmas for result in lemma.statement.cited)
        if cited or theorem.formerly or theorem.scope is not Scope.GENERAL:
            bound = theorem.formerly or (theorem.bound if theorem.scope is Scope.BOUNDED else "")
            rests = ", ".join(f"`{name}`" for name in cited)
            yield f"| {theorem.title} | {theorem.scope.value} | {bound.rstrip('.')} | {rests} |"


def _row(theorem: Theorem) -> str:
    asked = problems(theorem)
    count = {kind: sum(problem.kind is kind for problem in asked) for kind in Kind}
    claims = f"{count[Kind.CLAIM]} unsat"
    link = f"[{theorem.title}](#{_anchor(theorem.title)})"
    printed = f"{count[Kind.PRINTED]} refuted" if count[Kind.PRINTED] else "holds" if _is_printed(theorem) else ""
    cells = [link, theorem.source, theorem.scope.value, claims, claims, f"{count[Kind.BROKEN]} refuted", printed]
    return "| " + " | ".join(cells) + " |"


def _anchor(heading: str) -> str:
    """The name that the manual gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _by_source(theorem: Theorem) -> tuple[int, str]:
    """The papers first, then our own."""
    return ["[IRR", "[PIKE", "ours"].index(re.split(r"[, ]", theorem.source)[0]), theorem.name


def _is_printed(theorem: Theorem) -> bool:
    return not theorem.source.startswith("ours")


def _section(theorem: Theorem) -> str:
    parts = [
        f"\n## {theorem.title}\n",
        f"**Source:** {theorem.source}. **File:** `proofs/theorems/{theorem.name}.py`. "
        f"**Scope:** {theorem.scope.value}: {theorem.bound}\n",
        f"{theorem.words}\n",
        f"*Formalisation.* {theorem.formalisation}\n",
    ]
    if theorem.trusted:
        parts.append(f"*In words only.* {theorem.trusted}\n")
    parts += [_lemma(lemma) for lemma in theorem.lemmas]
    return "\n".join(parts)


def _lemma(lemma: Lemma) -> str:
    lines = [f"- **{lemma.name}.** {lemma.words}"]
    proved = {result.words for result in lemma.statement.cited}
    for label, words in (
        ("proved elsewhere", [one for one in lemma.statement.assumptions if one in proved]),
        ("assumes", [one for one in lemma.statement.assumptions if one not in proved]),
    ):
        if words:
            lines.append(f"  - {label}: {'; '.join(words)}.")
    lines += _variants("broken", lemma.broken)
    lines += _variants("as printed", lemma.printed)
    return "\n".join(lines) + "\n"


def _variants(label: str, variants: Iterable[Variant]) -> list[str]:
    return [f"  - {label}: {variant.words}" for variant in variants]
