"""The words of `bunraku provision` and `bunraku sensors ...` on the command line."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Fusion(StrEnum):
    """How the IMU finds its orientation."""

    imuplus = "imuplus"
    ndof = "ndof"


BoxFile = Annotated[
    Path | None,
    typer.Option(
        "--box", help="box.yaml of the venue: its key file, its control port. Left out: this box's."
    ),
]
KeyFile = Annotated[
    Path | None, typer.Option("--keys", help="Key file, instead of --box; left out: sensors.keys.")
]
Port = Annotated[
    str | None, typer.Option(help="Serial port of the wearable; left out: the only one that is plugged in.")
]
Network = Annotated[
    str | None, typer.Option(help="Name of the box's Wi-Fi network (2.4 GHz); left out: by cable only.")
]
PasswordFile = Annotated[
    Path | None,
    typer.Option(help="Its first line is the network's password, - for standard input; left out: asked for."),
]
FusionKind = Annotated[
    Fusion | None,
    typer.Option(help="imuplus: no compass, for stages with steel; ndof: with one. Left out: as it is."),
]
Axes = Annotated[
    str | None, typer.Option(metavar="MAP,SIGN", help="How the IMU sits: two hexadecimal registers, 24,00.")
]
Name = Annotated[str, typer.Argument(help="The sensor's name, as in the key file.")]

sensors = typer.Typer(
    help="List the sensors as the running box sees them; find, replace, revoke or rename one.",
    add_completion=False,
    pretty_exceptions_enable=False,
)


def provision(
    name: Annotated[str, typer.Option(help="What shows call it, for instance left-wrist.")],
    port: Port = None,
    box: BoxFile = None,
    keys: KeyFile = None,
    network: Network = None,
    password_file: PasswordFile = None,
    fusion: FusionKind = None,
    axes: Axes = None,
) -> None:
    """Give a wearable its name, its network and a fresh key, once, by cable."""
    from appliance.cli.provision import provision_sensor
    from appliance.cli.sensors import venue

    place = venue(box, keys)
    raise typer.Exit(provision_sensor(place, name, port, network, password_file, fusion, axes))


@sensors.callback(invoke_without_command=True)
def list_them(
    context: typer.Context,
    box: BoxFile = None,
    keys: KeyFile = None,
    watch: Annotated[bool, typer.Option("--watch", help="Look again each second, until Ctrl-C.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
) -> None:
    """List the sensors as the running box sees them; find, replace, revoke or rename one."""
    if context.invoked_subcommand is not None:
        if (box, keys, watch, as_json) != (None, None, False, False):
            raise typer.BadParameter(f"write options behind '{context.invoked_subcommand}'")
        return
    from appliance.cli.sensors import list_sensors, venue

    list_sensors(venue(box, keys), watch, as_json)


@sensors.command()
def strobe(name: Name, box: BoxFile = None, keys: KeyFile = None) -> None:
    """Let a sensor's light flash for 10 s, to find it in a drawer."""
    from appliance.cli.sensors import tell, venue

    tell(venue(box, keys), "/sensors/strobe", name)


@sensors.command()
def neutral(
    name: Annotated[str | None, typer.Argument(help="Left out: all sensors of the show.")] = None,
    box: BoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Take the neutral pose anew: how the sensor sits on the dancer, who stands still now."""
    from appliance.cli.sensors import tell, venue

    tell(venue(box, keys), "/sensors/neutral", *([name] if name else []))


@sensors.command()
def heading(
    name: Annotated[str | None, typer.Argument(help="Left out: all sensors of the show.")] = None,
    box: BoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Reset the heading alone: the dancer faces the front now."""
    from appliance.cli.sensors import tell, venue

    tell(venue(box, keys), "/sensors/heading", *([name] if name else []))


@sensors.command()
def replace(
    broken: Annotated[str, typer.Argument(help="The name to be taken over.")],
    spare: Annotated[
        str | None, typer.Argument(help="A spare that was provisioned before: no cable is needed.")
    ] = None,
    port: Annotated[
        str | None, typer.Option(help="Or the serial port of a new one, which is provisioned now.")
    ] = None,
    network: Network = None,
    password_file: PasswordFile = None,
    fusion: FusionKind = None,
    axes: Axes = None,
    box: BoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Put a spare, or a new wearable on a cable, in the place of a broken one."""
    from appliance.cli.provision import provision_sensor
    from appliance.cli.sensors import replace_by_spare, venue
    from appliance.stage.stage_error import StageError

    place = venue(box, keys)
    if (spare is None) == (port is None):
        raise StageError(
            f"Name a spare (bunraku sensors replace {broken} SPARE), or the --port of a new one."
        )
    if spare is not None:
        raise typer.Exit(replace_by_spare(place, broken, spare))
    raise typer.Exit(
        provision_sensor(place, broken, port, network, password_file, fusion, axes, takes_over=True)
    )


@sensors.command()
def revoke(name: Name, box: BoxFile = None, keys: KeyFile = None) -> None:
    """Let a stolen or lost sensor in no more: its key is removed."""
    from appliance.cli.sensors import revoke, venue

    raise typer.Exit(revoke(venue(box, keys), name))


@sensors.command()
def rename(
    name: Name,
    new: Annotated[str, typer.Argument(help="Its new name.")],
    box: BoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Give a sensor another name."""
    from appliance.cli.sensors import rename, venue

    raise typer.Exit(rename(venue(box, keys), name, new))


@sensors.command("reload")
def read_again(box: BoxFile = None, keys: KeyFile = None) -> None:
    """Let the running box read the key file that you changed by hand."""
    from appliance.cli.sensors import read_again, venue

    raise typer.Exit(read_again(venue(box, keys)))
