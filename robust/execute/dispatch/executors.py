"""Which deviations an executor accepts before it re-plans [IRR §5].

DREEX accepts what a box of parameter values allows that is proved to be inside the robustness envelope. BLEX(x), the
baseline, accepts any duration or consumption within x per cent of what was planned, and proves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.irr.box import Box, Interval
from robust.plan.model import ParametrizedPlan
from robust.plan.numerals import format_number, is_number, parse_number, shorten

_PLACE = Location("--executor")


@dataclass(frozen=True, slots=True)
class Dreex:
    """The executor that is guided by an envelope."""

    @property
    def name(self) -> str:
        return "dreex"


@dataclass(frozen=True, slots=True)
class Blex:
    """The optimistic baseline: `share` is the deviation that it accepts, 0.3 for BLEX(30)."""

    share: Fraction

    @property
    def name(self) -> str:
        return f"blex:{format_number(self.share * 100)}"

    def interval(self, value: Fraction) -> Interval:
        """[(1 − x)·v, (1 + x)·v]."""
        ends = sorted((value * (1 - self.share), value * (1 + self.share)))
        return Interval(ends[0], ends[1])

    def box(self, plan: ParametrizedPlan) -> Box:
        """The interval of every parameter, around its nominal value."""
        return Box({one.name: self.interval(one.nominal) for one in plan.parameters})


Executor = Dreex | Blex


def parse_executor(text: str) -> Executor:
    """`dreex`, or `blex:30` for 30 per cent; InputError for anything else."""
    name, colon, share = (part.strip() for part in text.lower().partition(":"))
    if name == "dreex" and not colon:
        return Dreex()
    if name != "blex":
        message = f"found {shorten(text)}, expected dreex or blex:PER_CENT{did_you_mean(name, ('dreex', 'blex'))}"
        raise InputError(message, _PLACE)
    if not is_number(share):
        raise InputError(f"found {shorten(text)}, expected a number of per cent such as blex:30", _PLACE)
    value = parse_number(share, _PLACE)
    if not 0 <= value <= 100:
        raise InputError(f"found {shorten(text)}, expected from 0 to 100 per cent", _PLACE)
    return Blex(value / 100)
