"""A page that shows a run while it goes on: what it shows of plans that are watched and of plans with choices.

The page is one file that loads nothing else; what it shows comes as one JSON object for each change. Times are rounded:
the answers that programs read have them exactly.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING, Any

from robust.draw.interactive import self_contained
from robust.draw.style import part
from robust.network.differences import delayed

if TYPE_CHECKING:
    from robust.execute.monitor import Outlook, StepOutlook
    from robust.pike_bridge.model import Choice
    from robust.pike_bridge.online.field import TeamExecutive
    from robust.pike_bridge.online.progress import Failed, Progress, Succeeded

LANES = 60
"""Steps on a page: the last ones that are over, all that run, and the first to come."""
OVER = 15
"""Of these, how many are over at most, if others wait to be shown."""
SAID = 8
"""The last messages that are shown."""
KINDS: Mapping[str, str] = {"on track": "good", "done": "good", "at risk": "open", "broken": "bad", "failed": "bad"}

Shown = dict[str, Any]
Said = tuple[str, str, str]
"""When something was said, what, and whether it is good, open or bad."""


def live_page(title: str) -> str:
    """The page of a run."""
    body = part("live.html").replace("{{title}}", escape(title))
    return self_contained(title, body, scripts=("live.js",), connects=True)


@dataclass
class LastWords:
    """The last things that were said: refusals, warnings, decisions, each with its time."""

    said: deque[Said] = field(default_factory=lambda: deque(maxlen=SAID))

    def add(self, time: Fraction, what: str, kind: str = "") -> None:
        """Something was said; `kind` is good, open, bad, or nothing."""
        self.said.append((f"{float(time):.6g}", what, kind))

    @property
    def newest_first(self) -> list[Said]:
        return list(self.said)[::-1]


def of_broken(outlook: Outlook, before: Outlook | None) -> Outlook:
    """The outlook of a broken plan, which has no steps, with those of the outlook before."""
    if before is None or outlook.running or outlook.startable or outlook.coming or outlook.prospect.value != "broken":
        return outlook
    return replace(outlook, running=before.running, startable=before.startable, coming=before.coming)


def watched(
    outlook: Outlook, ended: Sequence[tuple[str, str, Fraction, Fraction]], rate: Fraction | None, words: Sequence[Said]
) -> Shown:
    """What is shown of a plan that is watched; `rate` is seconds for a unit of time if a clock runs."""
    over = {step for step, *_ in ended}
    lanes = [_lane(step, name, "done", (start, end)) for step, name, start, end in ended]
    for state, looks in (("running", outlook.running), ("ready", outlook.startable), ("coming", outlook.coming)):
        lanes += [_ahead(look, state) for look in looks if look.step not in over]
    running = () if outlook.prospect.value == "broken" else outlook.running  # its ends decide nothing any more
    ends = sorted(running, key=lambda look: (look.end[1] is None, look.end[1] or 0))
    return {
        **_frame(outlook.time, rate, outlook.prospect.value, words),
        "reasons": list(outlook.reasons),
        "ends": [[look.name, look.step, float(look.end[1])] for look in ends if look.end[1] is not None],
        "promised": _promised(outlook),
        "success": None if outlook.success is None else [float(outlook.success.lower), float(outlook.success.upper)],
        **_some(lanes),
    }


def _promised(outlook: Outlook) -> list[list[Any]]:
    """The durations that are promised, as many as a page bears: step, least and greatest, None if there is no limit."""
    names = {look.step: look.name for look in (*outlook.running, *outlook.startable, *outlook.coming)}
    known = [(step, names[step], *lengths) for step, lengths in (outlook.promise or {}).items() if step in names]
    return [[step, name, float(low), None if high is None else float(high)] for step, name, low, high in known[:LANES]]


def _frame(time: Fraction, rate: Fraction | None, status: str, words: Sequence[Said]) -> Shown:
    return {
        "now": float(time),
        "rate": None if rate is None else float(rate),
        "status": status,
        "kind": KINDS.get(status, "open"),
        "said": list(words),
    }


def _ahead(look: StepOutlook, state: str) -> Shown:
    since = look.start[0] if look.since is None else look.since
    window = (look.start[0], look.start[1], look.end[1])
    return _lane(look.step, look.name, state, (since, look.end[0]), window)


def _lane(
    step: str,
    name: str,
    state: str,
    bar: tuple[Fraction, Fraction],
    window: tuple[Fraction, Fraction | None, Fraction | None] | None = None,
) -> Shown:
    """A row of the chart: a bar as expected, and its window: earliest and latest start, and latest end."""
    return {
        "id": step,
        "name": name,
        "state": state,
        "bar": [float(time) for time in bar],
        "window": None if window is None else [None if time is None else float(time) for time in window],
    }


def _some(lanes: Sequence[Shown]) -> Shown:
    """As many rows as a page bears, and how many are left out before and after."""
    over = sum(lane["state"] == "done" for lane in lanes)
    skipped = max(0, min(over - OVER, len(lanes) - LANES))
    shown = lanes[skipped : skipped + LANES]
    return {"lanes": list(shown), "before": skipped, "after": len(lanes) - skipped - len(shown)}


# -- plans with choices ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TeamMoment:
    """An execution at a moment, which goes on elsewhere; `possible` are values that open choices may still have."""

    progress: Progress
    running: Mapping[int, Fraction]
    outcome: Failed | Succeeded | None
    possible: Mapping[str, Sequence[str]]

    @classmethod
    def of(cls, executive: TeamExecutive, possible: Mapping[str, Sequence[str]]) -> TeamMoment:
        """What is known now, kept."""
        now = copy(executive.progress)
        now.times, now.chosen, now.pending = dict(now.times), dict(now.chosen), dict(now.pending)
        return cls(now, dict(executive.running), executive.outcome, dict(possible))

    def shown(self, rate: Fraction | None, words: Sequence[Said]) -> Shown:
        """What is shown of it."""
        lanes = sorted(self._lanes(), key=lambda lane: (_ORDER.index(lane["state"]), *lane["bar"]))
        status = "running" if self.outcome is None else _ENDED[self.outcome.kind()]
        reason = getattr(self.outcome, "reason", "")
        ends = [(lane["name"], "", lane["window"][2]) for lane in lanes if lane["state"] == "running"]
        return {
            **_frame(self.progress.now, rate, status, words),
            "reasons": [reason] if reason else [],
            "ends": [end for end in ends if end[2] is not None],
            "choices": [self._choice(choice) for choice in self.progress.plan.network.choices],
            **_some(lanes),
        }

    def _choice(self, choice: Choice) -> Shown:
        left = self.possible.get(choice.name)
        chosen = self.progress.chosen.get(choice.name)
        known = {"values": list(choice.domain), "chosen": chosen, "possible": None if left is None else list(left)}
        return {"name": choice.name, "ours": choice.controllable, **known}

    def _lanes(self) -> Iterator[Shown]:
        """A row for each activity that has been, is, or may still be carried out."""
        progress, windows = self.progress, event_windows(self.progress)
        for place, activity in enumerate(progress.plan.network.activities):
            names = (str(place), f"{'' if activity.agent is None else f'{activity.agent}: '}{activity.action}")
            start, end = progress.times.get(activity.source), progress.times.get(activity.target)
            if not progress.compatible(activity.guard) or any(
                value not in self.possible.get(choice, (value,)) for choice, value in activity.guard
            ):
                continue
            if start is not None and end is not None:
                yield _lane(*names, "done", (start, end))
            elif place in self.running:
                since, latest = self.running[place], windows[activity.target][1]
                yield _lane(
                    *names, "running", (since, max(since + activity.lower, progress.now)), (since, since, latest)
                )
            elif start is None and activity.source in windows and activity.target in windows:
                first, last = windows[activity.source]
                state = "coming" if progress.certain(activity.guard) else "open"
                window = (first, last, windows[activity.target][1])
                yield _lane(*names, state, (first, first + activity.lower), window)


_ORDER = ("done", "running", "coming", "open")
_ENDED = {"succeeded": "done", "failed": "failed"}


def words_of(decision: Mapping[str, Any]) -> tuple[str, str] | None:
    """What is said of an object that a service announces, and its kind; None if nothing is."""
    text, kind = _WORDS.get(decision["kind"], ("", ""))
    known = {key: "; ".join(map(str, value)) if isinstance(value, list) else value for key, value in decision.items()}
    return (text.format_map(known), kind) if text else None


_WORDS = {
    "chosen": ("{choice} = {value}", ""),
    "dispatched": ("{action} begins", ""),
    "rejected": ("refused: {message}: {reason}", "open"),
    "excluded": ("{event} excludes {lost}: {reason}", "open"),
    "violated": ("{atom} is not as expected", "bad"),
    "failed": ("failed: {reason}", "bad"),
    "succeeded": ("succeeded", "good"),
    "error": ("{message}", "bad"),
}
"""What is said of decisions, by their kind."""


def event_windows(progress: Progress) -> Mapping[str, tuple[Fraction, Fraction | None]]:
    """The earliest and the latest time of each event that has happened or may still come, if it does.

    By all bounds that hold whenever it is executed; what conditions, effects and other choices demand is not in them,
    so that events may have less room than this. Nothing that is open happens before now.
    """
    times, structure, pending = progress.times, progress.structure, progress.pending
    early = {event: times.get(event, progress.now) for event in (*times, *pending)}
    bounds = [
        (event, each, progress.certain(each.guard | structure.guards[event], structure.guards[each.source]))
        for event in pending
        for each in structure.incoming[event]
        if each.source in early and progress.certain(each.guard, structure.guards[event])
    ]
    early = delayed(early, [(each.source, event, each.lower) for event, each, _ in bounds if each.lower is not None])
    limits = [(each.source, event, -each.upper) for event, each, _ in bounds if each.upper is not None]
    limits += [  # before what certainly comes after it, and has a limit
        (event, each.source, each.lower)
        for event, each, comes in bounds
        if comes and each.source in pending and each.lower is not None
    ]
    backwards = delayed({event: -time for event, time in times.items()}, limits)
    return {event: (first, -backwards[event] if event in backwards else None) for event, first in early.items()}
