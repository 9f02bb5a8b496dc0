"""Certificates and what they establish, as JSON."""

from typing import Annotated

from msgspec import Meta

from robust.json_text import Count, JsonObject, Seconds, one_of
from robust.show.documents import Noted


class Certify(Noted, tag_field="schema", tag="robust/certify/1"):
    """robust certify --json: a certificate that has been written and checked."""

    kind: Annotated[str, one_of("plan", "box", "maximal", "shape", "region", "execution", "knowledge")]
    certificate: str
    bytes: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    checking_s: Seconds
    claim: str
    epsilon: str
    files: dict[str, str]
    obligations: Count
    refuted: Count
    alethe_holes: Count | None


class Proved(JsonObject):
    """The values of a parameter that have been proved."""

    lower: str
    upper: str
    lower_closed: bool
    upper_closed: bool


class Verify(JsonObject, tag_field="schema", tag="robust/verify/1"):
    """robust verify --json: what a certificate establishes of files with these digests."""

    verdict: Annotated[str, one_of("established", "rejected")]
    kind: str | None
    claim: str | None
    epsilon: str | None
    box: dict[str, Proved] | None
    files: dict[str, str]
    obligations: Count | None
    refuted: Count | None
    reason: str | None
    seconds: Seconds


DOCUMENTS: tuple[type[JsonObject], ...] = (Certify, Verify)
"""As in :mod:`robust.show.documents`."""
