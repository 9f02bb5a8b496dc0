"""Drake: temporal reasoning only, no causal links [PIKE §2.3 and §3; Conrad and Williams 2011]."""

from __future__ import annotations

from dataclasses import replace

from robust.pike_bridge.model import TeamPlan


def without_causes(plan: TeamPlan) -> TeamPlan:
    """The plan as Drake sees it: choices and times, but nothing that activities need, do or are to reach."""
    return replace(plan, conditions=(), effects=())
