"""`python -m hw_sim emulate ...`: the simulation without the box's command line."""

from __future__ import annotations

import typer

from hw_sim.commands import app

main = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
main.add_typer(app)


@main.callback()
def simulation() -> None:
    """Sensors, networks and receivers that stand in for the real ones."""


if __name__ == "__main__":
    main(prog_name="python -m hw_sim")
