"""`bunraku provision` and `bunraku sensors ...`: their options, and what each of them changes."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from appliance.cli.options import AsJson, ThisBoxFile, command_group, is_for_subcommand


class Fusion(StrEnum):
    """How the IMU finds its orientation."""

    imuplus = "imuplus"
    ndof = "ndof"


KeyFile = Annotated[
    Path | None, typer.Option("--keys", help="Key file, instead of --box. Default: sensors.keys.")
]
Port = Annotated[
    str | None, typer.Option(help="Serial port of the wearable. Default: the only one that is plugged in.")
]
Network = Annotated[
    str | None, typer.Option(help="Name of the box's Wi-Fi network (2.4 GHz). Default: by cable only.")
]
PasswordFile = Annotated[
    Path | None,
    typer.Option(help="Its first line is the network's password, - for standard input. Default: asked for."),
]
FusionKind = Annotated[
    Fusion | None,
    typer.Option(help="imuplus: no compass, for stages with steel; ndof: with one. Default: unchanged."),
]
Axes = Annotated[
    str | None, typer.Option(metavar="MAP,SIGN", help="How the IMU sits: two hexadecimal registers, 24,00.")
]
Crystal = Annotated[
    bool | None,
    typer.Option(
        "--crystal/--no-crystal",
        help="A 32 kHz crystal is fitted beside the IMU, for a steadier heading. Default: unchanged.",
    ),
]
Name = Annotated[str, typer.Argument(help="The sensor's name, as in the key file.")]
Anyway = Annotated[
    bool, typer.Option("--anyway", help="Also if the show wears the sensor, and loses it by that.")
]
NameOrAll = Annotated[str | None, typer.Argument(help="Left out: all sensors of the show.")]

sensors = command_group("List the sensors as the running box sees them; find, replace, revoke or rename one.")


def provision(
    name: Annotated[str, typer.Option(help="Its name in shows, for instance left-wrist.")],
    port: Port = None,
    box: ThisBoxFile = None,
    keys: KeyFile = None,
    network: Network = None,
    password_file: PasswordFile = None,
    fusion: FusionKind = None,
    axes: Axes = None,
    crystal: Crystal = None,
) -> None:
    """Give a wearable its name, its network and a fresh key, once, by cable."""
    from appliance.cli.sensors.box_keys import box_keys_of
    from appliance.cli.sensors.provision import provision_sensor

    box_keys = box_keys_of(box, keys)
    raise typer.Exit(provision_sensor(box_keys, name, port, network, password_file, fusion, axes, crystal))


@sensors.callback(invoke_without_command=True)
def list_them(
    context: typer.Context,
    box: ThisBoxFile = None,
    keys: KeyFile = None,
    watch: Annotated[bool, typer.Option("--watch", help="Look again each second, until Ctrl-C.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the sensors as the running box sees them; find, replace, revoke or rename one."""
    if is_for_subcommand(context, box, keys, watch, as_json):
        return
    from appliance.cli.sensors.box_keys import box_keys_of
    from appliance.cli.sensors.listing import list_sensors

    list_sensors(box_keys_of(box, keys), watch, as_json)


@sensors.command()
def strobe(name: Name, box: ThisBoxFile = None, keys: KeyFile = None) -> None:
    """Flash a sensor's light for 10 s, to find it in a drawer."""
    _send("/sensors/strobe", name, box, keys)


@sensors.command()
def neutral(name: NameOrAll = None, box: ThisBoxFile = None, keys: KeyFile = None) -> None:
    """Take the neutral pose again: the dancer must stand still, facing the front."""
    _send("/sensors/neutral", name, box, keys)


@sensors.command()
def heading(name: NameOrAll = None, box: ThisBoxFile = None, keys: KeyFile = None) -> None:
    """Reset only the heading: the dancer must face the front."""
    _send("/sensors/heading", name, box, keys)


@sensors.command()
def replace(
    broken: Annotated[str, typer.Argument(help="The sensor to replace; the new one takes its name.")],
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
    crystal: Crystal = None,
    anyway: Anyway = False,
    box: ThisBoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Put a spare, or a new wearable on a cable, in place of a broken one."""
    from appliance.cli.sensors.box_keys import box_keys_of, edit_keys
    from appliance.cli.sensors.provision import provision_sensor
    from appliance.cli.sensors.worn import refuse_worn, spares
    from appliance.stage.stage_error import StageError

    box_keys = box_keys_of(box, keys)
    if (spare is None) == (port is None):
        raise StageError(
            f"Name a spare (bunraku sensors replace {broken} SPARE), or the --port of a new one. "
            f"{spares(box_keys)}".rstrip()
        )
    if spare is not None:
        refuse_worn(box_keys, spare, f"in the place of {broken} it leaves its own", anyway)
        message = (
            f"{broken} is now the sensor that was {spare}; the broken one is called {spare} from now on. "
            "Put it on, switch it on, stand still for a breath."
        )
        raise typer.Exit(edit_keys(box_keys, lambda change: change.swap(broken, spare), message))
    wearable = network, password_file, fusion, axes, crystal
    raise typer.Exit(provision_sensor(box_keys, broken, port, *wearable, takes_over=True, anyway=anyway))


@sensors.command()
def revoke(name: Name, anyway: Anyway = False, box: ThisBoxFile = None, keys: KeyFile = None) -> None:
    """Lock out a stolen or lost sensor: its key is removed."""
    from appliance.cli.sensors.box_keys import box_keys_of, edit_keys
    from appliance.cli.sensors.worn import refuse_worn

    box_keys = box_keys_of(box, keys)
    refuse_worn(box_keys, name, "without its key it is not let in", anyway)
    message = f"{name} is revoked: its key opens nothing any more. To use it again, provision it again."
    raise typer.Exit(edit_keys(box_keys, lambda change: change.remove(name), message))


@sensors.command()
def rename(
    name: Name,
    new: Annotated[str, typer.Argument(help="Its new name.")],
    anyway: Anyway = False,
    box: ThisBoxFile = None,
    keys: KeyFile = None,
) -> None:
    """Give a sensor another name."""
    from appliance.cli.sensors.box_keys import box_keys_of, edit_keys
    from appliance.cli.sensors.worn import refuse_worn

    box_keys = box_keys_of(box, keys)
    refuse_worn(box_keys, name, f"as {new} it is none of the show's", anyway)
    message = f"{name} is now {new}. Shows name it by that."
    raise typer.Exit(edit_keys(box_keys, lambda change: change.rename(name, new), message))


@sensors.command("reload")
def read_again(box: ThisBoxFile = None, keys: KeyFile = None) -> None:
    """Make the running box read the key file again, after you changed it by hand."""
    from appliance.cli.sensors.box_keys import box_keys_of, clear_errors, reload_and_say
    from appliance.sensor.keys import load_keys

    box_keys = box_keys_of(box, keys)
    with clear_errors(box_keys.keys):
        load_keys(box_keys.keys)
    raise typer.Exit(reload_and_say(box_keys))


def _send(address: str, name: str | None, box: Path | None, keys: Path | None) -> None:
    from appliance.cli.sensors.box_keys import box_keys_of, send_command

    send_command(box_keys_of(box, keys), address, name)
