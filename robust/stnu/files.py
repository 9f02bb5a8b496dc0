"""Files of networks, of whatever format: GraphML of the CSTNU tool, JSON of HEATlab and pstnlib, `.cctp`, plain text.

The format is that of the content, whatever the file is called. Plain text is what L. Hunsberger's programs and the
CSTNU tool read as `.stn` or `.stnu` text: comments that begin with `#` say what follows, first the kind of network,
then how many time points, ordinary edges and contingent links there are, the names of the time points, `A 5 B` for each
edge B − A ≤ 5, and `A 2 4 C` for each contingent link from A to C of length [2, 4].
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

from robust.errors import InputError, Location, UnsupportedError
from robust.numbers import Number, exact, is_number, parse_number, plural, shorten
from robust.plan.pddl.forms import is_text, read_text
from robust.smt.limits import Deadline
from robust.stnu.cctp import read_cctp
from robust.stnu.graphml import INFINITE, graphml, parse_markup, read_graphml
from robust.stnu.network import ConditionalNetwork, Link, Network
from robust.stnu.network_json import network_json, parse_network_json


def read(path: str | os.PathLike[str]) -> Network | ConditionalNetwork:
    """The network in a file or a text, of the format of its content.

    Raises:
        InputError: at the place of whatever is wrong.
    """
    text, file = (path, "<network>") if is_text(path, _is_markup) else (read_text(path), os.fspath(path))
    begin = text.lstrip()[:1]
    if begin == "<":
        top = parse_markup(text, file, "GraphML or CCTP")
        return read_cctp(top, file) if top.tag.lower() == "cctp" else read_graphml(top, file)
    if begin in {"{", "["}:
        return parse_network_json(text, file)
    return parse_text(text, file)


def _is_markup(line: str) -> bool:
    """Whether a line is JSON or XML, rather than a path."""
    return line.lstrip()[:1] in {"{", "<"}


def load(path: str | os.PathLike[str]) -> Network:
    """The network in a file, of the format of its content.

    Args:
        path: GraphML of the CSTNU tool, JSON of DREAM or pstnlib, or the text of `.stn` and `.stnu` files; the path of
            the file, or what is in it.

    Returns:
        Time points, requirements and contingent links, with exact bounds in the unit of time of the file.

    Raises:
        InputError: at the place of whatever is wrong.
        UnsupportedError: for a network with choices or observations, about which :func:`robust.pike.controllable` can
            be asked.
    """
    network = read(path)
    if isinstance(network, ConditionalNetwork):
        names = ", ".join(choice.name for choice in network.choices)
        found = f"found a network with choices or observations ({names}), expected an STNU"
        remedy = (
            "robust stnu check decides whether this one is controllable, robust pike run --strategy executes it, "
            "robust pike check --controllable --repair mends bounds, and robust pike chance says how likely success is"
        )
        raise UnsupportedError(f"{found}; {remedy}", Location(network.name))
    return network


Source: TypeAlias = Network | str | os.PathLike[str]
"""A network, or the path or the text of one."""


def network_of(source: Source) -> Network:
    """A network itself, or the network in a file; errors as of :func:`load`."""
    if isinstance(source, Network):
        return source
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"found {shorten(repr(source))}, expected a network, a path or a text", Location("network"))
    return load(source)


def deadline(timeout: Number | None) -> Deadline:
    """The end of seconds from now; InputError unless they are a number of at least 0."""
    if timeout is None:
        return Deadline.after(None)
    seconds = exact(timeout, Location("timeout"))
    if seconds < 0:
        raise InputError(f"found {shorten(str(timeout))}, expected a number of at least 0", Location("timeout"))
    return Deadline.after(float(seconds))


def write(network: Network, path: str | os.PathLike[str]) -> tuple[str, int]:
    """The text of a network in the format of a suffix; nothing is written.

    Args:
        network: the network.
        path: a name that ends in `.json`, or in `.stnu`, `.graphml` or `.xml`: GraphML of the CSTNU tool.

    Returns:
        The text, and the factor of its times, which is 1 but in GraphML: there, lengths are whole numbers.

    Raises:
        InputError: for a suffix that is neither `.json` nor that of GraphML.
    """
    match Path(path).suffix.lower():
        case ".json":
            return network_json(network), 1
        case ".stnu" | ".graphml" | ".xml":
            return graphml(network)
    raise InputError(f"found {shorten(str(path))}, expected a name that ends in .stnu or .json")


# -- plain text --------------------------------------------------------------------------------------------------------

_KINDS = ("stn", "stnu")
_COUNTED = 3
"""Numbers before the names: of time points, edges and contingent links."""


def parse_text(text: str, file: str) -> Network:
    """The network that a plain text describes; `file` is its name in messages.

    Raises:
        InputError: at the place of whatever is wrong.
    """
    lines = list(_lines(text, file))
    if not lines or len(lines[0][0]) != 1 or lines[0][0][0].lower() not in _KINDS:
        start = shorten(" ".join(lines[0][0])) if lines else _nothing(text)
        expected = "a network as GraphML, CCTP, JSON, or text that begins with STN or STNU"
        raise InputError(f"found {start}, expected {expected}", lines[0][1] if lines else Location(file, 1))
    rest = lines[1:]
    counts: list[tuple[int, Location]] = []
    while rest and len(rest[0][0]) == 1 and rest[0][0][0].isdecimal() and len(counts) < _COUNTED:
        words, place = rest.pop(0)
        counts.append((int(words[0]), place))
    nodes = dict[str, None]()
    while rest and (len(nodes) < counts[0][0] if counts else not nodes):
        for name in rest[0][0]:
            if name in nodes:
                hint = f"; line {counts[0][1].line} says {plural(counts[0][0], 'time point')}" if counts else ""
                raise InputError(f"found a second time point {shorten(name)}, expected one{hint}", rest[0][1])
            nodes[name] = None
        rest.pop(0)
    links = [_text_link(words, place, nodes) for words, place in rest]
    found = (len(nodes), sum(not link.is_contingent for link in links), sum(link.is_contingent for link in links))
    for what, number, (said, place) in zip(("time point", "edge", "contingent link"), found, counts, strict=False):
        if number != said:
            raise InputError(f"found {plural(number, what)}, expected {said} as the file says", place)
    return Network(file, tuple(nodes), tuple(links), "Z" if "Z" in nodes else None)


def _nothing(text: str) -> str:
    """What there is in a text without a word."""
    return "only comments" if text.strip() else "only blank lines" if text else "an empty file"


def _lines(text: str, file: str) -> Iterator[tuple[list[str], Location]]:
    """The words of each line that has any, and its place."""
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            yield words, Location(file, number)


def _text_link(words: Sequence[str], place: Location, nodes: dict[str, None]) -> Link:
    """`A 5 B` or `A 2 4 C`."""
    if len(words) not in {3, 4} or not all(is_number(word) or INFINITE.get(word.lower()) for word in words[1:-1]):
        expected = "A NUMBER B for an edge, or A LEAST MOST C for a contingent link"
        raise InputError(f"found {shorten(' '.join(words))}, expected {expected}", place)
    for name in (words[0], words[-1]):
        if name not in nodes:
            raise InputError(f"found unknown time point {shorten(name)}, expected one of the names", place)
    numbers = [None if INFINITE.get(word.lower()) == 1 else parse_number(word, place) for word in words[1:-1]]
    if len(words) == 3:
        return Link(words[0], words[2], None, numbers[0], place=place)
    return Link(words[0], words[3], numbers[0], numbers[1], True, place)
