"""How help looks: at 80 columns nothing is cut, options stand in groups, and no type is shown where a name tells it."""

from __future__ import annotations

from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperOption

MESSAGES = "Messages"
"""The last group of options: what the program says, and how it runs."""


def help_text(text: str) -> str:
    """Join the lines of each paragraph, which Typer would break where they end.

    Paragraphs that begin with a backspace stay as they are, which is Typer's own sign.
    """
    paragraphs = text.strip("\n").split("\n\n")
    return "\n\n".join(p if p.startswith("\b") else " ".join(p.split()) for p in paragraphs)


def default_note(shown: str) -> str:
    """Return the end of an option's help, for a default that the function has and the option has not."""
    return f" [dim]\\[default: {shown}][/dim]"


def without_type(param: Any) -> None:
    """Let help show no type of flags and arguments: ``<bool>`` and ``<list[str]>`` tell users nothing."""
    if isinstance(param, TyperArgument):
        param.display_type_rich = lambda ctx: ""
    elif isinstance(param, TyperOption) and param.is_flag and param.metavar is None:
        param.metavar = ""


class Command(TyperCommand):
    """A command with the help that all have."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for param in self.params:
            without_type(param)

    def get_help_option(self, ctx: Any) -> Any:
        """Put the option that shows the help into the last group."""
        option = super().get_help_option(ctx)
        if option is not None:
            option.rich_help_panel = MESSAGES
            without_type(option)
        return option
