"""unified-planning: its problems and plans in and out, and the engine `robust` that judges plans for it.

An optional extra, imported only when one of these functions is called:

>>> import robust.unified_planning                                                          # doctest: +SKIP
>>> robust.unified_planning.register()                                                      # doctest: +SKIP
>>> with up.shortcuts.PlanValidator(name="robust") as validator:                            # doctest: +SKIP
...     validator.validate(problem, plan)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robust.unified_planning.convert import from_unified_planning, to_unified_planning
from robust.unified_planning.problems import module_of

if TYPE_CHECKING:
    from unified_planning.environment import Environment

__all__ = ["from_unified_planning", "register", "to_unified_planning"]

NAME = "robust"


def register(environment: Environment | None = None) -> None:
    """Add the engine `robust` to an environment of unified-planning; the global one if none is given.

    It validates sequential, time-triggered and STN plans. Once it is there, nothing is done.

    Args:
        environment: one of unified-planning's.

    Raises:
        UnsupportedError: if unified-planning is not installed.
    """
    factory = (environment or module_of("unified_planning.environment").get_environment()).factory
    if NAME not in factory.engines:
        factory.add_engine(NAME, "robust.unified_planning.engine", "RobustValidator")
