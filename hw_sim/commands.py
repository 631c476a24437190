"""`bunraku emulate`: sensors without sensors, for developers, tests and technicians."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from appliance.options.idle_options import refuse_idle
from appliance.pose.file_trouble import sentence
from hw_sim import motions
from hw_sim.casting import MOST_SENSORS, MotionKind, cast_sensors, choose_keys, name_and_motion, parse_axis
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator, Sender
from hw_sim.firmware import firmware_maker
from hw_sim.measure import measure
from hw_sim.network import PROFILES, VenueNetwork
from hw_sim.senders import SendLog, SerialSender, UdpSender
from hw_sim.status import StatusLine
from hw_sim.traces import read_trace

REFUSED, UNANSWERED = 2, 1

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
app.command()(measure)


class NetworkKind(StrEnum):
    """Behaviour of the network."""

    venue = "venue"
    perfect = "perfect"
    bad = "bad"


class Imu(StrEnum):
    """Inertial unit of the simulated board, one of IMUS."""

    bno055 = "bno055"
    bno085 = "bno085"
    lsm6dsv = "lsm6dsv"


@app.command()
def emulate(
    context: typer.Context,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="Sensor to emulate, by name; repeat for more. NAME=MOTION gives it a motion of its own."
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            min=1, max=MOST_SENSORS, help="Emulate the first COUNT sensors of the key file. Default: all."
        ),
    ] = None,
    motion: Annotated[MotionKind, typer.Option(help="How the sensors move.")] = MotionKind.turning,
    axis: Annotated[str, typer.Option(help="Axis x,y,z of turning and step.")] = "0,1,0",
    seconds_per_turn: Annotated[
        float, typer.Option(help="Pace of turning; negative: the other direction.")
    ] = 5.0,
    step_degrees: Annotated[float, typer.Option(help="How far a step jumps, at most 40.")] = 30.0,
    step_every: Annotated[float, typer.Option(min=0.04, help="Seconds from step to step.")] = 1.0,
    trace: Annotated[
        Path | None, typer.Option(help="Recording for the motion trace: BVH, or CSV with time_s,w,x,y,z.")
    ] = None,
    joint: Annotated[str | None, typer.Option(help="Which joint of the BVH.")] = None,
    host: Annotated[str, typer.Option(help="Where the box is.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Its UDP port for sensors.")] = 9750,
    serial: Annotated[Path | None, typer.Option(help="Serial device instead of the network.")] = None,
    baud: Annotated[int, typer.Option(min=1200, help="Speed of the serial device.")] = 115200,
    stand_still: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Seconds that the dancer stands still after the first reading: the box takes the neutral "
            "pose. 0: dances at once.",
        ),
    ] = 2.0,
    tap: Annotated[
        bool,
        typer.Option("--tap", help="A double tap at the start: the box takes the neutral pose sooner."),
    ] = False,
    network: Annotated[
        NetworkKind,
        typer.Option(
            help="venue: Wi-Fi as measured in a theatre; perfect; bad: everything goes wrong at once."
        ),
    ] = NetworkKind.venue,
    keys: Annotated[
        Path,
        typer.Option(help="Key file, the one that the box reads; written with fresh keys if there is none."),
    ] = Path("sensors.keys"),
    reboot_every: Annotated[
        float | None, typer.Option(min=1.0, help="Seconds after which each sensor is switched off and on.")
    ] = None,
    drift_ppm: Annotated[
        float, typer.Option(min=-5000, max=5000, help="How much too fast the sensors' clocks are.")
    ] = 0.0,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.0, help="End after this time, else at Ctrl-C; 0: only write keys."),
    ] = None,
    firmware: Annotated[
        bool,
        typer.Option("--firmware", help="Each sensor runs the compiled firmware (first: make firmware)."),
    ] = False,
    imu: Annotated[
        Imu, typer.Option(help="With --firmware: the inertial unit that is wired to the sensors' boards.")
    ] = Imu.bno055,
    seed: Annotated[int, typer.Option(help="The same seed gives the same dance and the same network.")] = 1,
    log: Annotated[
        Path | None, typer.Option(help="Write a CSV line for each reading as it was sent.")
    ] = None,
) -> None:
    """Emulate one to eight wearable sensors: they pair with the box, then send signed readings at 50 Hz each.

    Packets cross a lifelike network in both directions, each sensor from its own address. The box must
    read the same key file.
    """

    def motion_of(number: int, name: str) -> motions.Motion:
        match kinds.get(name) or motion:
            case MotionKind.turning:
                return motions.turning(parse_axis(axis), seconds_per_turn)
            case MotionKind.dance:
                return motions.dance(seed + number)
            case MotionKind.step:
                return motions.step(parse_axis(axis), step_degrees, step_every)
            case MotionKind.trace:
                return read_trace(trace, joint)
            case _:
                return motions.still()

    if serial is None:
        refuse_idle(context, ("baud",), "without --serial")
    else:
        refuse_idle(context, ("host", "port", "network"), "with --serial")
    if not firmware:
        refuse_idle(context, ("imu",), "without --firmware")
    try:
        wanted = [name_and_motion(message) for message in sensor or []]
        kinds = dict(wanted)
        if MotionKind.trace not in (motion, *kinds.values()):
            refuse_idle(context, ("trace", "joint"), "without the motion 'trace'")
        chosen, remarks = choose_keys(keys, [name for name, _ in wanted], count)
        for remark in remarks:
            typer.echo(remark, err=True)
        if tap and firmware:
            raise ValueError("--tap is not for --firmware, whose sensors feel a finger on their case")
        if serial is not None and len(chosen) > 1:
            raise ValueError(f"a cable carries one sensor, not {len(chosen)}; say which one with --sensor")
        sensors = cast_sensors(
            chosen,
            motion_of,
            seed,
            stand_still_s=stand_still,
            taps=tap,
            drift_ppm=drift_ppm,
            reboot_every_s=reboot_every,
            make=firmware_maker(imu=imu) if firmware else EmulatedSensor,
        )
        senders: list[dict[Lane, Sender]] = [
            {Lane.NETWORK: UdpSender(host, port)}
            if serial is None
            else {Lane.CABLE: SerialSender(str(serial), baud)}
            for _ in sensors
        ]
    except (ValueError, OSError) as error:
        _refuse(error)
    where = f"{host}:{port}" if serial is None else str(serial)
    on_air = VenueNetwork(PROFILES[network.value], seed)
    try:
        with (
            _stopped_by_signals() as should_stop,
            SendLog(log) if log is not None else nullcontext() as on_sent,
            closing(Emulator(sensors, senders, network=on_air, on_sent=on_sent)) as emulator,
        ):
            if seconds == 0:  # the keys are written
                return
            with StatusLine(where) as status:
                emulator.run(seconds, should_stop, lambda: status.show(emulator, time.monotonic()))
                is_taken = status.end(emulator)
    except OSError as error:
        _refuse(error)
    if not is_taken:
        raise typer.Exit(UNANSWERED)


@contextmanager
def _stopped_by_signals() -> Iterator[Callable[[], bool]]:
    """SIGTERM and Ctrl-C end the run after the current datagram."""
    stopped: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: stopped.append(number))
        for number in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield lambda: bool(stopped)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _refuse(error: Exception) -> NoReturn:
    message = (sentence(error) if isinstance(error, OSError) else None) or f"{str(error).rstrip('.')}."
    typer.echo(f"bunraku emulate: {message}", err=True)
    sys.exit(REFUSED)
