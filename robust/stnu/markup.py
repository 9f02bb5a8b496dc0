"""XML as a tree in which every element knows its line, and GraphML: elements with data by key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from robust.errors import InputError, Location


@dataclass(slots=True)
class Element:
    """A tag without its namespace, its attributes, what is in it, its text without blanks around, and its place."""

    tag: str
    attributes: Mapping[str, str]
    place: Location
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def within(self) -> Iterator[Element]:
        """The element itself and all that are inside of it, in the order of the file."""
        pending = [self]
        while pending:
            yield (element := pending.pop())
            pending.extend(reversed(element.children))


def parse_markup(text: str, file: str, expected: str) -> Element:
    """The outermost element of an XML text.

    Args:
        file: its name in messages.
        expected: the format, for messages.

    Raises:
        InputError: at the place where it is no XML, or declares a document type, which could define anything.
    """
    parser = expat.ParserCreate()
    open_elements: list[Element] = []
    texts: list[list[str]] = []
    done: list[Element] = []

    def place() -> Location:
        return Location(file, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def doctype(*_: object) -> None:
        raise InputError(f"found a document type, expected {expected} without one", place())

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag.rpartition(":")[2], attributes, place())
        if open_elements:
            open_elements[-1].children.append(element)
        open_elements.append(element)
        texts.append([])

    def end(_: str) -> None:
        done.append(open_elements.pop())
        done[-1].text = "".join(texts.pop()).strip()

    def characters(data: str) -> None:
        texts[-1].append(data)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = characters, doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        where = Location(file, error.lineno, error.offset + 1)
        raise InputError(f"found broken XML ({reason}), expected {expected}", where) from None
    except ValueError as error:  # an encoding that it names and Python lacks
        raise InputError(f"found broken XML ({error}), expected {expected}", Location(file)) from None
    return done[-1]
