"""The command `eclipsejax`. Each subcommand is a module of `commands`; heavy modules load only where they are used."""

from collections.abc import Sequence
from functools import partial

from eclipsejax import session
from eclipsejax.commands import chart, doctor, gallery, listing, movie, render, texture

COMMANDS = (listing, chart, render, movie, texture, gallery, doctor)
UNWELL = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status: 0, 2 for what cannot be used, 1 for a self-test that failed."""
    try:
        return session.run("eclipsejax", partial(_command, arguments))
    except doctor.Unwell:
        return UNWELL


def _command(arguments: Sequence[str] | None) -> None:
    options = _parser().read(arguments)
    options.action(options)


def _parser() -> session.Arguments:
    parser = session.Arguments(prog="eclipsejax", description="Lunar eclipses: when they are, and what they look like.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", title="commands")
    for command in COMMANDS:
        command.add_to(commands)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
