"""Plans with choices in the words of the verified checker: what the files say, which it trusts, and certificates.

What a network and its PDDL mean is read by the checker in Python; the verified one is told which spans between events,
which demands and which gains of atoms that makes, and proves the rest by itself.
"""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction

from robust.certify.checker.choices import Choices, Condition, Files, Guard, execution_text, knowledge_text, of_files
from robust.certify.checker.claims import Claim
from robust.certify.checker.formulas import FALSE, TRUE
from robust.certify.checker.proofs import Tape, demand, listed
from robust.certify.kernel.evaluation import IndexedFacts
from robust.certify.kernel.questions import OpenFormulas
from robust.certify.kernel.terms import listed as listed_words
from robust.certify.kernel.terms import truth, unsupported
from robust.smt.limits import Deadline

Span = tuple[str, str, Fraction | None, Fraction | None, Guard]
"""From an event until another one, the least and the greatest time between them, and for which choices."""


class TeamTerms(Choices):
    """A plan with choices as the checker in Python reads it, as lists."""

    def __init__(self, files: Files, epsilon: Fraction) -> None:
        self._spans: list[Span] = []
        super().__init__(files, epsilon)
        self._event = {event: number for number, event in enumerate(self.guards)}
        self._choice = {name: number for number, name in enumerate(self.domains)}
        atoms = dict.fromkeys(each.atom for each in (*self.conditions, *self.effects))
        self._atom = {atom: number for number, atom in enumerate(atoms)}

    def constrain(self, guard: Guard, a: str, b: str, low: Fraction | None, high: Fraction | None) -> None:
        super().constrain(guard, a, b, low, high)
        self._spans.append((a, b, low, high, guard))

    def bound(self, guard: Guard, literal: int) -> None:
        super().bound(guard, literal)
        self._spans += ((*span, guard) for span in self._said(literal))

    def _said(self, literal: int) -> Iterator[tuple[str, str, Fraction | None, Fraction | None]]:
        """What a literal about durations says of events."""
        if literal == TRUE:
            return
        if literal == FALSE:
            yield "e_initial", "e_initial", Fraction(1), None
        elif self.circuit.is_gate(abs(literal)) and literal > 0:
            for part in self.circuit.nodes[literal]:
                yield from self._said(part)
        else:
            if self.circuit.is_gate(abs(literal)):
                raise unsupported("a condition on durations that is no conjunction")
            form, strict = self.circuit.said(literal)
            later, sooner = ([name for name, factor in form.items() if name and factor * sign > 0] for sign in (1, -1))
            if strict or len(later) != 1 or len(sooner) != 1 or form[later[0]] != -form[sooner[0]]:
                raise unsupported("a condition on durations of several activities, or a strict one")
            events = {variable: event for event, time in self.times.items() for variable in time}
            yield events[sooner[0]], events[later[0]], Fraction(-form.get("", 0), form[later[0]]), None

    def sections(self) -> list[str]:
        """The plan, line by line."""
        spans = (
            listed_words((self._event[a], self._event[b], _bound(low), _bound(high), self.label(guard)))
            for a, b, low, high, guard in self._spans
        )
        demands = (self._literal(each, self._event[each.first], self._event[each.last]) for each in self.conditions)
        gains = (self._literal(each, self._event[each.first]) for each in self.effects)
        parts = {"choices": map(len, self.domains.values()), "spans": spans, "demands": demands, "gains": gains}
        return [listed_words((name, *items)) for name, items in parts.items()]

    def label(self, guard: Guard) -> str:
        values = ((self._choice[name], self.domains[name].index(value)) for name, value in guard.items())
        return listed_words(map(listed_words, values))

    def _literal(self, each: Condition, *events: int) -> str:
        owner = "-" if each.activity is None else each.activity
        return listed_words((self._atom[each.atom], truth(each.value), *events, self.label(each.guard), owner))


def _bound(number: Fraction | None) -> str:
    return "-" if number is None else str(number)


class TeamTranslation:
    """A certificate that there is a correct execution, or none, in the verified checker's words.

    Args:
        files: the network, domain and problem.
        epsilon: how far apart events have to be.
        deadline: when to give up, with OutOfTimeError.

    Raises:
        UnsupportedError: if the verified checker does not know what the plan says.
    """

    def __init__(self, files: Files, epsilon: Fraction, deadline: Deadline) -> None:
        self._files, self._epsilon, self._deadline = files, epsilon, deadline
        self._plan = TeamTerms(files, epsilon)

    def claim(self, tape: Tape, kind: str, stated: object) -> tuple[Claim, str]:
        """What is claimed, for people; and in the checker's words, without a proof.

        Raises:
            Rejected: if a line of the certificate is not what is expected.
        """
        claim = Claim(kind, self._epsilon)
        if kind == "execution":
            demand(stated is None, "the certificate of an execution has no assumptions")
            values, times = line = listed(tape.next("execution"), 2)
            choices = Choices(self._files, self._epsilon, line)
            claim.choices, claim.text = choices.chosen, execution_text(choices)
            words = f"(execution {listed_words(values)} {listed_words('0' if t is None else t for t in times)})"
        else:
            claim.choices = dict(listed(stated))
            self._plan.holds(claim.choices)  # refuses unknown values
            claim.text = knowledge_text(claim.choices)
            tape.next("refute")  # for the other checker
            words = f"(none {self._plan.label(claim.choices)})"
        tape.finish()
        claim.text += f"{of_files(self._files)}, epsilon = {self._epsilon}"
        return claim, words

    def file(self, words: str, kind: str, texts: Sequence[str], ask: Callable[[str], str]) -> str:
        """The checker's whole input; `texts` are what the files are, which it repeats.

        Raises:
            NotRefutedError: if there is a correct execution although the certificate says that there is none.
            OutOfTimeError: if the deadline passes.
        """
        head = "\n".join([listed_words(("texts", *texts)), f"(epsilon {self._epsilon})", *self._plan.sections()])
        if kind != "execution":
            formulas = OpenFormulas.of(ask(f"{head}\n{words}\n").split())
            words = f"{words[:-1]} {formulas.refutation(IndexedFacts([], 0, {}), self._deadline)})"
        return f"{head}\n{words}\n"
