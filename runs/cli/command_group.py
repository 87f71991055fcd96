"""A group of commands that answers a mistyped one with the nearest name."""

from __future__ import annotations

import click

from regrid.errors import BadInput, suggest


class Commands(click.Group):
    """Commands in the order of a first acquaintance; a mistyped one gets the nearest name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def resolve_command(self, ctx: click.Context, args: list[str]):
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            words = " ".join(ctx.command_path.split()[1:])
            within = f" of {words!r}" if words else ""
            hint = suggest(args[0], self.commands)
            raise BadInput(f"there is no command {args[0]!r}{within}{hint}")
        return super().resolve_command(ctx, args)
