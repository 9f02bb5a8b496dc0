"""What must be done about a threat to a labeled causal link [PIKE §4.4, Figure 12].

The nine cases tell apart how the threat lies to the producer (columns) and to the consumer (rows):

====================  ====================  =====================  ====================
threat …              before the producer   either                 after the producer
====================  ====================  =====================  ====================
before the consumer   C1: nothing           C2: force it before    C3: avoid it
either                C4: nothing           C5: before or after    C6: force it after
after the consumer    C7: nothing           C8: nothing            C9: nothing
====================  ====================  =====================  ====================

C4, C7 and C8 are impossible where the producer precedes the consumer and precedence is fully known. With partial
knowledge they mean that nothing need be done: the threat is known to be on one side.

"After the consumer" is after the condition's end, "before the consumer" is at its end or earlier. A threat at the very
event of the producer or of the condition lies in the closed interval from the one to the other, so it is a C3.
"""

from __future__ import annotations

from enum import Enum

from robust.pike_bridge.causal.links import Contexts, Happening, OpenCondition


class Resolution(Enum):
    """What keeps a threat out of the interval from a producer to its consumer."""

    NOTHING = "nothing required"
    AVOID = "conflict"
    BEFORE = "threat before producer"
    AFTER = "threat after consumer"
    EITHER = "threat before producer or after consumer"


def resolve(question: OpenCondition, producer: Happening, threat: Happening, contexts: Contexts) -> Resolution:
    """The case of Figure 12, in the context in which the producer, the threat and the consumer are all activated."""
    if threat.event in {producer.event, question.first, question.last}:
        return Resolution.AVOID

    def precedes(first: str, second: str) -> bool:
        return contexts.precedes(first, second, producer.guard, threat.guard)

    if precedes(threat.event, producer.event) or precedes(question.last, threat.event):
        return Resolution.NOTHING
    after_producer = precedes(producer.event, threat.event)
    before_consumer = precedes(threat.event, question.last)
    match after_producer, before_consumer:
        case True, True:
            return Resolution.AVOID
        case True, False:
            return Resolution.AFTER
        case False, True:
            return Resolution.BEFORE
        case _:
            return Resolution.EITHER
