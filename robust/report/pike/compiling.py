"""`robust pike compile`: counts and times of offline compilation, and the prime implicants if wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.errors import UnsupportedError
from robust.report import options
from robust.report.guard import Cause, Guard
from robust.report.numbers import duration
from robust.report.output import answering, print_json
from robust.report.pike.requests import guarded
from robust.report.progress import Display
from robust.report.terminal import console
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from rich.console import Console

    from robust.pike_bridge.compile import Compiling
    from robust.pike_bridge.knowledge.interface import HasImplicants, KnowledgeBase

SCHEMA = "robust/pike-compile/1"
STAGES = ("precedence", "links", "conflicts", "knowledge")
PITMS = "pitms"
LONGEST_LISTING = 1_000_000
"""Prime implicants are counted exactly, but not listed beyond this."""


@dataclass(frozen=True)
class PikeCompileRequest:
    """The options as they were typed."""

    file: Path
    backend: str = "pitms"
    temporal: str = "lazy"
    solver: str = "z3"
    epsilon: str = "1/1000"
    shortcut: bool = True
    implicants: bool = False
    models: bool = True
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class Compiled:
    """What is known of a compilation; None where it did not get so far."""

    backend: str
    temporal: str
    solver: str
    status: str = "complete"
    candidate_subplans: int | None = None
    counts: dict[str, int] = field(default_factory=dict)
    satisfiable: bool | None = None
    prime_implicants: int | None = None
    models: int | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    statistics: dict[str, Any] = field(default_factory=dict)
    implicants: list[dict[str, str]] | None = None


@dataclass
class _Run:
    request: PikeCompileRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    limit: float | None
    compiled: Compiled | None = None
    compiling: Compiling | None = None

    def compile(self) -> Compiled:
        from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415 - imports the grammar
        from robust.pike_bridge.compile import Compiling, Temporal  # noqa: PLC0415 - imports solvers
        from robust.pike_bridge.knowledge import knowledge_bases  # noqa: PLC0415
        from robust.pike_bridge.scenarios import candidate_subplans  # noqa: PLC0415

        request = self.request
        able = [name for name, registration in knowledge_bases().items() if registration.knows_implicants]
        if request.implicants and request.backend not in able:
            raise UnsupportedError(
                f"--implicants: back end {request.backend} has no prime implicants; "
                f"expected --backend {' or '.join(able)}"
            )
        plan = load_team_plan(request.file, epsilon=self.epsilon)
        compiled = self.compiled = Compiled(request.backend, request.temporal, request.solver)
        deadline = Deadline.after(self.guard.remaining(self.limit))
        self.compiling = Compiling(
            plan,
            request.backend,
            temporal=Temporal(request.temporal),
            solver=request.solver,
            shortcut=request.shortcut,
            deadline=deadline,
            on_stage=self.display.say,
            seconds=compiled.seconds,
        )
        try:
            compiled.candidate_subplans = candidate_subplans(plan.network)
            self.compiling.run()
            self._ask(compiled, deadline)
        except OutOfTimeError:
            compiled.status = "timeout"
        self._count(compiled)
        return compiled

    def _ask(self, compiled: Compiled, deadline: Deadline) -> None:
        knowledge = self.compiling.knowledge if self.compiling is not None else None
        if knowledge is None:
            return
        compiled.satisfiable = knowledge.satisfiable(deadline)
        questions = (self._ask_models, self._ask_implicants)
        # Labels hold the prime implicants already, so that these are known even if there is no time to count models.
        for question in reversed(questions) if compiled.backend == PITMS else questions:
            question(compiled, knowledge, deadline)

    def _ask_models(self, compiled: Compiled, knowledge: KnowledgeBase, deadline: Deadline) -> None:
        if self.request.models:
            self.display.say("counting models")
            compiled.models = knowledge.count_models(deadline)

    def _ask_implicants(self, compiled: Compiled, knowledge: KnowledgeBase, deadline: Deadline) -> None:
        from robust.pike_bridge.knowledge.interface import HasImplicants  # noqa: PLC0415 - imports solvers

        if isinstance(knowledge, HasImplicants):
            self.display.say("counting prime implicants")
            compiled.prime_implicants = knowledge.implicant_count(deadline)
            if self.request.implicants:
                compiled.implicants = _listed(knowledge, compiled.prime_implicants, deadline)

    def _count(self, compiled: Compiled) -> None:
        """What the stages that ended have made."""
        if self.compiling is None:
            return
        network = self.compiling.plan.network
        compiled.counts |= {
            "choices": len(network.choices),
            "events": len(network.events),
            "activities": len(network.activities),
            "conditions": len(self.compiling.plan.conditions),
        }
        if (augmented := self.compiling.augmented) is not None:
            compiled.counts |= {
                "choice_variables": len(augmented.theory.domains),
                "links": len(augmented.links),
                "added_orderings": len(augmented.network.constraints) - len(network.constraints),
                "propositional_constraints": len(augmented.theory.constraints) + len(augmented.theory.conflicts),
            }
        if self.compiling.conflicts is not None:
            compiled.counts["temporal_conflicts"] = len(self.compiling.conflicts)
        compiled.statistics = asdict(self.compiling.statistics)

    def known(self) -> Compiled | None:
        if self.compiled is not None:
            self.compiled.status = "timeout" if self.guard.cause is Cause.TIMEOUT else "interrupted"
            self._count(self.compiled)
        return self.compiled

    def show(self, compiled: Compiled) -> None:
        if self.request.json:
            print_json(compile_answer(compiled))
            return
        with answering():
            _print(console(), compiled, quiet=self.request.quiet)


def run_pike_compile(request: PikeCompileRequest, guard: Guard) -> int:
    """Compile and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted while files were being read.
    """
    with Display(shown=request.progress, what="reading") as display:
        run = _Run(
            request,
            guard,
            display,
            epsilon=options.positive(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
        )
        compiled = guarded(guard, run.limit, display, run.compile, run.known, run.show)
    run.show(compiled)
    return 0 if compiled.status == "complete" else 3


def _listed(knowledge: HasImplicants, count: int, deadline: Deadline) -> list[dict[str, str]]:
    if count > LONGEST_LISTING:
        raise UnsupportedError(
            f"--implicants: found {count:,} to list, expected at most {LONGEST_LISTING:,}; "
            "without the option they are counted only"
        )
    return [dict(sorted(implicant)) for implicant in knowledge.prime_implicants(deadline)]


def compile_answer(compiled: Compiled) -> dict[str, Any]:
    """`robust/pike-compile/1`."""
    answer: dict[str, Any] = {
        "schema": SCHEMA,
        "status": compiled.status,
        "backend": compiled.backend,
        "temporal": compiled.temporal,
        "solver": compiled.solver,
        "satisfiable": compiled.satisfiable,
        "candidate_subplans": compiled.candidate_subplans,
        **compiled.counts,
        "prime_implicants": compiled.prime_implicants,
        "models": compiled.models,
        "seconds": {stage: round(spent, 6) for stage, spent in compiled.seconds.items()},
        "statistics": compiled.statistics,
    }
    if compiled.implicants is not None:
        answer["implicants"] = compiled.implicants
    return answer


def _print(out: Console, compiled: Compiled, *, quiet: bool) -> None:
    out.print(_headline(compiled))
    if quiet:
        return
    for name, value in _facts(compiled).items():
        out.print(f"  {name}: {value}")
    for implicant in compiled.implicants or ():
        out.print("  {" + ", ".join(f"{name} = {value}" for name, value in implicant.items()) + "}")


def _headline(compiled: Compiled) -> str:
    if compiled.status != "complete":
        reached = [stage for stage in STAGES if stage in compiled.seconds]
        after = f" in stage {reached[-1]!r}" if reached else ""
        return f"Not compiled: {'out of time' if compiled.status == 'timeout' else 'interrupted'}{after}."
    return "Compiled: a correct execution exists." if compiled.satisfiable else "Compiled: no correct execution exists."


def _facts(compiled: Compiled) -> Mapping[str, str]:
    counts = {
        "candidate subplans": compiled.candidate_subplans,
        **{name.replace("_", " "): value for name, value in compiled.counts.items()},
        "prime implicants": compiled.prime_implicants,
        "models": compiled.models,
    }
    times = {f"{stage}, time": duration(spent) for stage, spent in compiled.seconds.items()}
    return {name: f"{value:,}" for name, value in counts.items() if value is not None} | times
