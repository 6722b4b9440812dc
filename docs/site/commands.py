"""The page of the commands in Markdown, as the command line itself is declared."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from orchestration.api.declaration import REQUIRED, Option
from orchestration.cli import app as command_line

_MARKUP = re.compile(r"\[/?(?:bold|italic|dim|cyan|green|yellow|red)?\]")  # of rich
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~])")  # of Markdown


def describe_commands() -> str:
    """Return Markdown: a section for each command, with its arguments and options."""
    root = typer.main.get_command(command_line.app)
    return "\n".join(line for name, command in below(root) for line in section(name, command))


def below(command: Any, words: str = "ppy") -> Iterator[tuple[str, Any]]:
    """List the commands below a group by the words that call them, groups before their own."""
    for name in command.list_commands(None):
        one = command.get_command(None, name)
        yield f"{words} {name}", one
        if hasattr(one, "list_commands"):
            yield from below(one, f"{words} {name}")


def section(words: str, command: Any) -> Iterator[str]:
    """Lines on a command."""
    yield f"\n## {words}\n"
    yield f"{plain(command.help or '')}\n"
    options: dict[str, Option] = getattr(command.callback, "__options__", {})
    placed = [value_of(option) for option in options.values() if option.argument]
    if options:
        flagged = ["[OPTIONS]"] * (len(options) > len(placed))
        yield f"```text\n{' '.join([words, *flagged, *placed])}\n```\n"
    for option in options.values():
        yield f"* {called(option)}: {plain(option.help)}{default_of(option)}"
    if examples := re.findall(r"^ *(ppy .+)$", command.epilog or "", re.M):
        yield "\n".join(["", "```sh", *(line.replace("\\[", "[") for line in examples), "```"])


def value_of(option: Option) -> str:
    """Return what stands for the value of an option, nothing for a switch."""
    if option.argument or option.metavar:
        return option.metavar or option.name.upper()
    return "" if isinstance(option.default, bool) or len(option.flags) > 1 else "VALUE"


def called(option: Option) -> str:
    """Return an argument or an option as it is typed."""
    flags = [""] if option.argument else [*option.flags, *filter(None, [option.alias])]
    return ", ".join(f"`{f'{flag} {value_of(option)}'.strip()}`" for flag in flags)


def default_of(option: Option) -> str:
    """Return what holds where an option is not given, if that is a value."""
    if option.default in (None, REQUIRED, (), "") or isinstance(option.default, bool):
        return ""
    return f" Default: `{option.form.write(option.default)[0]}`."


def plain(text: str) -> str:
    """Return a help text as Markdown that reads the same."""
    return _SPECIAL.sub(r"\\\1", _MARKUP.sub("", text))
