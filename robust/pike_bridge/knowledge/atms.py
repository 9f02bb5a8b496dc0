"""The ATMS, to compare with: the same nodes, with labels that are only minimal [PIKE §5.1.1]."""

from __future__ import annotations

from robust.pike_bridge.knowledge.goal import Joining
from robust.pike_bridge.knowledge.labels import without_manifest
from robust.pike_bridge.knowledge.tms import LabelKnowledgeBase


class Atms(LabelKnowledgeBase):
    """No environment of a label manifests a known conflict, but extensions of it may.

    So a query must look for an extension that resolves all conflicts, which the label alone does not tell.
    """

    name = "atms"
    consensus = False

    def _create_joining(self) -> Joining:
        return Joining(self._vocabulary, without_manifest, resolved=False)
