"""Durations learnt from logs, for people and as JSON."""

from robust.execute.learned import Learned, LearntAction
from robust.json_text import JsonObject, Rational, Seconds, like, on_wire
from robust.numbers import duration, plural, readable
from robust.show import documents
from robust.show.console import Console, Text, printing
from robust.show.tables import show_table, table


@printing.register(Learned)
def print_learned(out: Console, learned: Learned, *, quiet: bool) -> None:
    """A row for each action; unless `quiet` also what limits mean, and what is not known."""
    columns = ["action", "runs", "failed", "from", "to", "longest", "later runs"]
    rows = [_cells(name, action) for name, action in learned.actions.items()]
    show_table(out, table(columns, rows, right=("runs", "failed", "from", "to", "longest")))
    if quiet:
        return
    actions = learned.actions.values()
    out.print()
    for sentence in _sentences(learned):
        out.print(Text(f"  {sentence}"), soft_wrap=True)
    counted = f"{plural(sum(action.runs for action in actions), 'run')} of {plural(len(actions), 'action')}"
    out.print(Text(f"{counted}; {duration(learned.seconds)}.", style="dim"), soft_wrap=True)


def _cells(name: str, action: LearntAction) -> tuple[str, ...]:
    longest = "" if action.longest is None else readable(action.longest)
    upper = "?" if action.upper is None else readable(action.upper)
    drift = action.drift
    change = "" if drift is None or not drift.found else f"differ: {readable(drift.earlier)} → {readable(drift.later)}"
    return name, str(action.runs), str(action.failed or ""), readable(action.lower), upper, longest, change


def _sentences(learned: Learned) -> list[str]:
    actions = learned.actions.values()
    cover, confidence = (f"{float(100 * share):g} %" for share in (learned.cover, learned.confidence))
    promised = [action for action in actions if action.upper is not None]
    sentences = [f"to: covers {cover} of future runs with {confidence} confidence, if they are as those in the logs."]
    if len(promised) < len(actions):
        missing = plural(len(actions) - len(promised), "action")
        needed = f"a limit needs {next(iter(actions)).needed}, of the later half where runs differ"
        sentences.append(f"?: {missing} with too few runs: {needed}.")
    if drifting := sum(action.drift is not None and action.drift.found for action in actions):
        what = "medians of the earlier and the later half; limits hold for the later half by itself too"
        sentences.append(f"later runs of {plural(drifting, 'action')} differ: {what}.")
    for count, what in (
        (sum(action.failed for action in actions), "failed: no limit counts failures"),
        (sum(action.unfinished for action in actions), "did not end in the logs"),
        (sum(action.clock_resets for action in actions), "took unknown time: the clock was set back"),
    ):
        if count:
            sentences.append(f"{plural(count, 'run')} {what}.")
    return sentences


on_wire("LearntAction", values=None)


class Learn(documents.Noted, tag_field="schema", tag="robust/learn/1"):
    """robust learn --json: durations of actions, learnt from logs

    Attributes:
        cover: the share of future runs that limits cover
        confidence: with which they do
    """

    cover: Rational
    confidence: Rational
    actions: dict[str, LearntAction]
    seconds: Seconds


@documents.documenting.register(Learned)
def _(learned: Learned) -> documents.Document:
    return documents.document(like(Learn, learned, actions=dict(learned.actions)))


documents.has_table(
    Learned, "actions", named="action", numbers=("lower", "upper", "longest", "drift_earlier", "drift_later")
)
DOCUMENTS: tuple[type[JsonObject], ...] = (Learn,)
