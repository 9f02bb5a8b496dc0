"""`{command} robust envelope` in a page becomes the reference of that command, from what the code declares of it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from docutils import nodes
from docutils.parsers.rst import Directive

from robust.cli.build import Command, Group, Option, declared, names_of
from robust.cli.main import COMMANDS, HELP


def commands() -> dict[str, Command | Group]:
    """All commands by what is typed, groups before what is in them."""
    found: dict[str, Command | Group] = {}
    for name, entry in COMMANDS.items():
        found[f"robust {name}"] = entry
        if isinstance(entry, Group):
            found |= {f"robust {name} {inner}": command for inner, command in entry.load().items()}
    return found


def usage(command: str, options: Mapping[str, Option]) -> str:
    """`robust check [OPTIONS] DOMAIN PROBLEM PLAN`."""
    words = [command, "[OPTIONS]"]
    for name, one in options.items():
        if one.argument:
            word = (one.metavar or name.upper()) + ("..." if one.many else "")
            words.append(word if one.default is ... else f"[{word}]")
    return " ".join(words)


def typed(name: str, one: Option) -> str:
    """`--solver <z3|cvc5>`, as help shows it."""
    if one.argument:
        return one.metavar or name.upper()
    words = ", ".join(sorted(names_of(name, one), key=lambda word: word.startswith("--"))).replace("/", ", ")
    if one.flag:
        return words
    value = (
        f"<{'|'.join(one.choices)}>" if one.choices else one.metavar or ("N" if type(one.default) is int else "TEXT")
    )
    return f"{words} {value}"


def told(one: Option) -> str:
    """What an option does, its default, and whether it may be left out."""
    text = one.help
    if one.default is ...:
        return f"{text} (required)"
    if one.argument or one.flag or one.default is None or one.default in ((), ""):
        return text
    return f"{text} [default: {one.default}]"


class CommandReference(Directive):
    """What a command does, how it is called, and all its options; of a group, its commands."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The paragraphs and lists of the page."""
        name = self.arguments[0]
        if name == "robust":
            return [nodes.paragraph("", HELP), *self._table(COMMANDS, "robust")]
        entry = commands().get(name)
        if entry is None:
            raise self.error(f"found no command {name!r}, expected one of {', '.join(commands())}")
        if isinstance(entry, Group):
            return [nodes.paragraph("", entry.help), *self._table(entry.load(), name)]
        action = entry.load()
        options = declared(action.options)
        call = nodes.literal_block("", usage(name, options), language="text")
        return [*self._paragraphs(action.help), call, *self._options(options)]

    def _paragraphs(self, text: str) -> Iterator[nodes.Node]:
        for paragraph in re.split(r"\n\s*\n", text.strip()):
            yield nodes.paragraph("", " ".join(paragraph.split()))

    def _options(self, options: Mapping[str, Option]) -> Iterator[nodes.Node]:
        rows = [(typed(name, one), told(one)) for name, one in options.items()]
        rows.append(("-h, --help", "show help and exit"))
        yield _list(rows)

    def _table(self, table: Mapping[str, Command | Group] | Mapping[str, Command], name: str) -> Iterator[nodes.Node]:
        yield _list([(f"{name} {inner}", entry.help) for inner, entry in table.items()])


def _list(rows: list[tuple[str, str]]) -> nodes.Node:
    found = nodes.definition_list()
    for term, text in rows:
        item = nodes.definition_list_item()
        item += nodes.term("", "", nodes.literal("", term))
        item += nodes.definition("", nodes.paragraph("", text))
        found += item
    return found


def setup(app: object) -> dict[str, bool]:
    """Register the directive with Sphinx."""
    app.add_directive("command", CommandReference)  # type: ignore[attr-defined]
    return {"parallel_read_safe": True, "parallel_write_safe": True}
