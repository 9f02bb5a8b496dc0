"""Plans with choices to `.tpnu.json`: one line for each part, every number exact."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias

from robust.errors import InputError, Location
from robust.pike_bridge.document_reader import FORMAT, parse_tpnu
from robust.pike_bridge.model import Activity, Choice, Constraint, Event, Guard, Tpnu
from robust.plan.numerals import format_number

_Value: TypeAlias = str | bool | Fraction | tuple[str, ...] | dict[str, str] | None


def write_tpnu(path: str | os.PathLike[str], network: Tpnu, *, domain: str, problem: str) -> None:
    """Write a network as a `.tpnu.json` file.

    Args:
        domain: the path of the domain as it is to be written: relative to the file.
        problem: the path of the problem, likewise.

    Raises:
        InputError: if the file cannot be written, or the network is not one that :func:`tpnu_text` can write.
    """
    text = tpnu_text(network, domain=domain, problem=problem)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"cannot write ({reason}), expected a file that can be written", Location(str(path))) from None


def tpnu_text(network: Tpnu, *, domain: str, problem: str) -> str:
    """The text of the `.tpnu.json` file of a network; reading it gives the same network.

    Raises:
        InputError: if the network has what the format cannot say: a choice that no event decides or without values, a
            guard with two values of one choice, an empty name, or an action that is no PDDL in lower case.
    """
    heads = {"format": FORMAT, "name": network.name, "domain": domain, "problem": problem}
    lists = {
        "choices": [_choice(choice) for choice in network.choices],
        "events": [_event(event) for event in network.events],
        "constraints": [_constraint(constraint) for constraint in network.constraints],
        "activities": [_activity(activity) for activity in network.activities],
    }
    members = [f"  {_json(key)}: {_json(value)}" for key, value in heads.items()]
    members += [f"  {_json(key)}: {_rows(rows)}" for key, rows in lists.items()]
    text = "{\n" + ",\n".join(members) + "\n}\n"
    if parse_tpnu(text, network.name).network != network:
        expected = "actions in lower case with single blanks, and one value of a choice in each guard"
        raise InputError(f"plan {network.name!r} would not be read as it was written; expected {expected}")
    return text


def _choice(choice: Choice) -> dict[str, _Value]:
    if choice.event is None:
        raise InputError(f"choice {choice.name!r} has no event; expected one to write the plan to a file")
    return {
        "name": choice.name,
        "domain": choice.domain,
        "controllable": choice.controllable,
        "at": choice.event,
    }


def _event(event: Event) -> dict[str, _Value]:
    return {"name": event.name, **_guard(event.guard)}


def _constraint(constraint: Constraint) -> dict[str, _Value]:
    return {
        "from": constraint.source,
        "to": constraint.target,
        "lower": constraint.lower,
        "upper": constraint.upper,
        **_guard(constraint.guard),
    }


def _activity(activity: Activity) -> dict[str, _Value]:
    return {
        "action": activity.action,
        "from": activity.source,
        "to": activity.target,
        "lower": activity.lower,
        "upper": activity.upper,
        **({} if activity.agent is None else {"agent": activity.agent}),
        **_guard(activity.guard),
    }


def _guard(guard: Guard) -> dict[str, _Value]:
    return {"guard": dict(sorted(guard))} if guard else {}


def _rows(rows: Iterable[Mapping[str, _Value]]) -> str:
    lines = [f"    {{{', '.join(f'{_json(key)}: {_json(value)}' for key, value in row.items())}}}" for row in rows]
    return "[\n" + ",\n".join(lines) + "\n  ]" if lines else "[]"


def _json(value: _Value) -> str:
    """JSON text; fractions that are no decimals are texts."""
    if isinstance(value, Fraction):
        text = format_number(value)
        return f'"{text}"' if "/" in text else text
    return json.dumps(value, ensure_ascii=False)
