"""Planners behind one interface: libraries of the extra `planners`, and any program by its command.

They are created by name, or by the command that starts them.
"""

from collections.abc import Callable, Mapping
from fractions import Fraction

from robust.encode.interface import EPSILON
from robust.errors import InputError, closest, missing
from robust.execute.planners.interface import Planner, command_planner, kairos_planner
from robust.execute.planners.reachability import ReachabilityFirst


def _aries(*, epsilon: Fraction) -> Planner:
    try:
        from robust.execute.planners.aries import aries_planner  # noqa: PLC0415 - needs unified-planning
    except ImportError as error:
        raise missing("planner aries (package up-aries)", "planners") from error
    return aries_planner(epsilon=epsilon)


_COMMAND = "command:"
_MAKERS: Mapping[str, Callable[..., Planner]] = {"aries": _aries, "kairos": kairos_planner}

PLANNERS = tuple(sorted(_MAKERS))
"""The planners with a name."""


def create_planner(name_or_command: str, *, epsilon: Fraction = EPSILON) -> Planner:
    """The planner `aries` or `kairos`, or the one that `command:TEMPLATE` starts.

    In a template, `{domain}` and `{problem}` are PDDL files, `{output}` is a file for the plan (standard output is read
    if it is not written), and `{timeout}` is the seconds that are left. Plans are checked with mutex time points
    `epsilon` apart. None of them is asked for what :mod:`robust.execute.planners.reachability` proves to be impossible.

    Raises:
        InputError: for an unknown name or a template that cannot be used.
        UnsupportedError: if the package of the planner is not installed.
    """
    text = name_or_command.strip()
    if text.startswith(_COMMAND):
        return ReachabilityFirst(command_planner(text.removeprefix(_COMMAND), epsilon=epsilon))
    if text not in _MAKERS:
        known = f"{', '.join(PLANNERS)} or command:TEMPLATE"
        raise InputError(f"found planner {name_or_command!r}, expected {known}{closest(text, PLANNERS)}")
    return ReachabilityFirst(_MAKERS[text](epsilon=epsilon))
