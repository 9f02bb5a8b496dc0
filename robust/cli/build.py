"""From declared options to commands: reading a command line, and explaining one that is wrong or asks for help.

A command line in order is read here, in a moment. Help, completion and whatever is wrong are left to typer, for which
the same declarations become the parameters of a function; only the command that was asked for is imported.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from robust.cli.guard import EPILOG, Action
from robust.numbers import shorten
from robust.options.declare import Option, Options, declared, names_of

if TYPE_CHECKING:
    import typer


@dataclass(frozen=True, slots=True)
class Command:
    """A command in the list of its group: one line of help, and where its action is, `module:name`."""

    help: str
    target: str

    def load(self) -> Action[Any]:
        action = _at(self.target)
        if not isinstance(action, Action):
            raise TypeError(f"{self.target} is not the action of a command")
        return action


@dataclass(frozen=True, slots=True)
class Group:
    """Commands under one word: a mapping, or where one is, `module:name`, imported when it is asked for."""

    help: str
    commands: Mapping[str, Command] | str

    def load(self) -> Mapping[str, Command]:
        if not isinstance(self.commands, str):
            return self.commands
        commands: Mapping[str, Command] = _at(self.commands)
        return commands


def _at(target: str) -> Any:
    """The object that `module:name` names."""
    module, name = target.split(":")
    return getattr(import_module(module), name)


Table = Mapping[str, Command | Group]


# -- a command line in order -------------------------------------------------------------------------------------------


def read(table: Table, words: Sequence[str]) -> tuple[Action[Any], dict[str, Any]] | None:
    """The action that is asked for and what is given of its options; None if the line is not in order."""
    entry: Command | Group | None = table.get(words[0]) if words else None
    rest = words[1:]
    if isinstance(entry, Group):
        entry, rest = entry.load().get(rest[0]) if rest else None, rest[1:]
    if entry is None:
        return None
    asked = entry.load()
    values = read_options(asked.options, rest)
    return None if values is None else (asked, values)


def read_options(options: type[Options], words: Sequence[str]) -> dict[str, Any] | None:
    """The values given for options; None if the words are not well-formed."""
    declarations = declared(options)
    by_word: dict[str, tuple[str, bool]] = {}
    for name, declaration in declarations.items():
        if not declaration.argument:
            for typed in names_of(name, declaration):
                positive, _, negative = typed.partition("/")
                by_word[positive] = (name, True)
                if negative:
                    by_word[negative] = (name, False)
    values: dict[str, Any] = {}
    places: list[str] = []
    rest = iter(words)
    for word in rest:
        if not word.startswith("-") or word == "-":
            places.append(word)
            continue
        typed, equals, text = word.partition("=")
        if typed not in by_word:
            return None
        name, state = by_word[typed]
        declaration = declarations[name]
        if declaration.flag:
            if equals:
                return None
            values[name] = state
            continue
        if equals and not typed.startswith("--"):
            return None
        given = text if equals else next(rest, None)
        if given is None or not _keep(values, name, declaration, given):
            return None
    return values if _place(values, declarations, places) else None


def _keep(values: dict[str, Any], name: str, declaration: Option, text: str) -> bool:
    """Keep a value if it is in order."""
    value: Any = text
    if declaration.choices and text not in declaration.choices:
        return False
    if isinstance(declaration.default, int):
        if not text.removeprefix("-").isascii() or not text.removeprefix("-").isdecimal():
            return False
        value = int(text)
    elif declaration.path:
        value = Path(text)
    values[name] = (*values.get(name, ()), value) if declaration.many else value
    return True


def _place(values: dict[str, Any], declarations: Mapping[str, Option], places: list[str]) -> bool:
    """Give words without a name to arguments in order; whether all fit, and nothing is missing."""
    for name, declaration in declarations.items():
        if declaration.argument:
            taken = len(places) if declaration.many else 1
            for word in places[:taken]:
                _keep(values, name, declaration, word)
            del places[:taken]
        if declaration.default is ... and name not in values:
            return False
    return not places


# -- everything else: typer --------------------------------------------------------------------------------------------


CarryOut = Callable[[Action[Any], dict[str, Any]], int]


def application(table: Table, words: Sequence[str], help: str, version: str, carry_out: CarryOut) -> typer.Typer:
    """All commands by name, and those on the way to the one that is asked for with their options."""
    import typer

    def show_version(wanted: bool) -> None:
        if wanted:
            typer.echo(version)
            raise typer.Exit

    version_option = Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=show_version)
    ]

    def top(version: bool = False) -> None:
        pass

    top.__annotations__["version"] = version_option
    app = typer.Typer(
        name="robust",
        help=help,
        epilog=EPILOG,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    )
    app.callback()(top)
    asked = [word for word in words if not word.startswith("-")]
    _add(app, table, asked, carry_out)
    return app


def _add(app: typer.Typer, table: Table, asked: Sequence[str], carry_out: CarryOut) -> None:
    import typer

    for name, entry in table.items():
        wanted = asked[:1] == [name]
        if isinstance(entry, Group):
            commands = entry.load() if wanted else {name: Command("", "")}
            group = typer.Typer(name=name, help=entry.help, no_args_is_help=True, rich_markup_mode=None)
            _add(group, commands, asked[1:] if wanted else (), carry_out)
            app.add_typer(group)
        elif wanted:
            action = entry.load()
            register = app.command(name, short_help=entry.help, help=action.help, epilog=action.epilog)
            register(_function(action, carry_out))
        else:
            app.command(name, short_help=entry.help)(lambda: 0)


def _function(asked: Action[Any], carry_out: CarryOut) -> Callable[..., int]:
    """A function whose signature is the options, for typer."""
    import typer

    def called(context: typer.Context, **values: Any) -> int:
        given = {}
        for name, value in values.items():
            source = context.get_parameter_source(name)
            if source is not None and source.name == "COMMANDLINE":
                given[name] = tuple(value) if isinstance(value, list) else getattr(value, "value", value)
        return carry_out(asked, given)

    parameters = [inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)]
    for name, declaration in declared(asked.options).items():
        kind, shown = _type(declaration)
        make = typer.Argument if declaration.argument else typer.Option
        names = () if declaration.argument else names_of(name, declaration)
        explicit = not (declaration.argument or declaration.default is ...)
        parser = _whole_number if kind in (int, int | None) else None
        information = make(
            *names, help=declaration.help, metavar=declaration.metavar, show_default=explicit, parser=parser
        )
        parameters.append(
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if shown is ... else shown,
                annotation=Annotated[kind, information],
            )
        )
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


def _whole_number(given: str) -> int:
    import typer

    try:
        return int(given)
    except ValueError:
        raise typer.BadParameter(f"found {shorten(given)}, expected a whole number") from None


def _enumeration(values: tuple[str, ...]) -> Any:
    return StrEnum("Choice", {value: value for value in values})


def _type(declaration: Option) -> tuple[Any, Any]:
    """The type and the default as typer has them."""
    kind: Any = str
    default = declaration.default
    if declaration.choices:
        kind = _enumeration(declaration.choices)
        default = default if default in {None, ...} else kind(default)
    elif declaration.flag:
        kind = bool
    elif isinstance(default, int):
        kind = int
    elif declaration.path:
        kind = Path
    if declaration.many:
        kind, default = list[kind], default or None
    return (kind | None if default is None else kind), default
