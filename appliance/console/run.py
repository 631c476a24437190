"""The page's process: serves browsers, asks the box once a second, until a stop signal."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import ipaddress
import signal
import socket
import ssl
import time
from functools import partial
from pathlib import Path

from aiohttp import web

from appliance.box.door import Door
from appliance.box.fallback import Fallbacks
from appliance.box.notify import Notifier
from appliance.box.open_files import open_more_files
from appliance.box.process_health import ProcessHealthWriter
from appliance.box.realtime import give_way
from appliance.box.runtime_folder import restored_file
from appliance.box.served import addresses
from appliance.box.show_state import ShowStateReader
from appliance.console import certificate
from appliance.console.about import About
from appliance.console.box_view import BoxView
from appliance.console.browser_hands import BrowserHands
from appliance.console.certificate import certificate_in, https_context
from appliance.console.desk import Desk
from appliance.console.devices import Devices
from appliance.console.fallback import OF_THE_PAGE, note_crowd
from appliance.console.fleet import Fleet
from appliance.console.guard import Guard
from appliance.console.happened import Happened
from appliance.console.help import Help
from appliance.console.learn import Learn
from appliance.console.logs import Logs
from appliance.console.midi import Midi
from appliance.console.night import Night
from appliance.console.phones import Phones
from appliance.console.pose_map import PoseMap
from appliance.console.prove import Prove
from appliance.console.rehearsed import FOLDER, ZIP, Rehearsed
from appliance.console.report import settings_in, watch
from appliance.console.rig import Rig
from appliance.console.seen_stage import SeenStage
from appliance.console.sensor_changes import SensorChanges
from appliance.console.server import Server
from appliance.console.settings import WHERE, ConsoleSettings
from appliance.console.show_goes import show_goes
from appliance.console.stage_view import StageView
from appliance.console.update import Update
from appliance.console.venue import Venue
from appliance.console.watchers import Watchers

TICK_S = 0.02
_REFRESH_S = 1.0
_PULSE_S = 0.1
_IDLE_S = 0.2  # how often the stage is looked for while no browser shows the dance
_NICER = 10
_LAST_REQUESTS_S = 0.5
_WAITING_CONNECTIONS = 256
_NAMED_S = 5.0  # how often the certificate is looked at: a network may come after the page


def run_console(settings: ConsoleSettings) -> int:
    """Serve the page until SIGTERM or Ctrl-C; the exit status. Raises OSError where it has no place."""
    give_way(_NICER)
    open_more_files()
    with restored_file(Path(settings.folder) / WHERE):
        return asyncio.run(_serve(settings))


async def _serve(settings: ConsoleSettings) -> int:
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    folder = Path(settings.folder)
    devices, stage, watchers = Devices(Path(settings.devices)), StageView(folder), Watchers()
    fallbacks = Fallbacks(OF_THE_PAGE)
    door, desk = Door(partial(note_crowd, fallbacks)), Desk(settings.control)
    guard = Guard(settings.viewers, settings.names, devices, door)
    seen = SeenStage(folder, stage)
    box = BoxView(desk, stage, seen, ShowStateReader(folder))
    health, notifier = ProcessHealthWriter(folder, "console", fallbacks), Notifier()
    happened, about = Happened(guard, settings.journal), About(settings.box)
    prove = Prove(folder, Path(settings.devices).parent, settings.box, settings.is_installed)
    logs = Logs(folder, settings.is_installed)
    rehearsed = Path(settings.devices).parent / FOLDER
    state, goes = Path(settings.devices).parent, partial(show_goes, folder)
    venue = Venue(folder, settings.box, settings.is_installed, state, goes)
    learn = Learn(state, settings.journal, settings.box, settings.is_installed, stage)
    night = Night(stage, box, Path(settings.devices).parent, folder)
    helping = Help(box, logs, folder, settings.journal, settings.box)
    hands, rig = BrowserHands(guard, desk, folder), Rig(folder)
    phones = Phones(guard, door, settings.phones, folder, fallbacks)
    others = [*prove.routes(), *logs.routes(), *venue.routes(), *rig.routes(), *phones.routes()]
    update = Update(folder, settings.is_installed, goes)
    others += [*Midi(stage, box).routes(), *Fleet(state, stage).routes()]
    others += [*night.routes(), *helping.routes(), *update.routes()]
    others += certificate.routes(Path(settings.devices).parent)
    named = ("--box", settings.box["box"]) if "box" in settings.box else ()
    others += SensorChanges(stage, named).routes()
    if settings.rehearsal:
        others += Rehearsed(stage, box, Path(settings.devices).parent).routes()
        others += [*hands.routes(), *PoseMap(stage).routes(), *learn.routes()]
    parts = (guard, devices, desk, stage, box, watchers, happened, about, fallbacks)
    reported = {"rehearsal": settings.rehearsal, "installed": settings.is_installed}
    app = Server(*parts, lambda: {**reported, "cue_kept": (rehearsed / ZIP).is_file()}, others).app()
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=_LAST_REQUESTS_S, keepalive_timeout=30.0)
    await runner.setup()
    listening = socket.socket(fileno=settings.descriptor)
    listening.setblocking(False)
    listening.listen(_WAITING_CONNECTIONS)
    context, serve = _https(settings) if settings.https else None, runner.server
    assert serve is not None
    notifier.ready("The page is served.")
    gc.freeze()  # the collector counts only what browsers leave, and so takes it before it is a megabyte
    await learn.go_on()
    tasks = [
        asyncio.create_task(door.accept(listening, serve, context)),
        asyncio.create_task(door.watch()),
        asyncio.create_task(_pulse(notifier, health)),
        asyncio.create_task(_refresh(box, watchers)),
        asyncio.create_task(_send_frames(stage, watchers)),
        asyncio.create_task(hands.watch()),
        asyncio.create_task(phones.watch()),
        asyncio.create_task(night.watch()),
        *_reporting(folder, box, fallbacks),
        *([] if context is None else [asyncio.create_task(_renew(context, settings, door))]),
        asyncio.create_task(stopped.wait()),
    ]
    ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    notifier.stopping()
    for task in tasks:
        task.cancel()
    await watchers.close()
    await prove.close()
    await learn.close()
    await hands.close()
    phones.close()
    await runner.cleanup()
    listening.close()
    faults = [fault for task in ended if (fault := task.exception())]
    if faults:  # a task of ours broke: start anew, and let its traceback be seen
        health.close()
        raise faults[0]
    health.end(time.monotonic())
    health.close()
    stage.close()
    seen.close()
    rig.close()
    return 0


def _reporting(folder: Path, box: BoxView, fallbacks: Fallbacks) -> list[asyncio.Task[None]]:
    wanted = settings_in(folder)
    return [] if wanted is None else [asyncio.create_task(watch(wanted, lambda: box.value, fallbacks))]


def _https(settings: ConsoleSettings) -> ssl.SSLContext:
    return https_context(_certificate(settings))


def _certificate(settings: ConsoleSettings) -> Path:
    """The file, made anew where it lacks an address or a name that the box has now. Raises OSError."""
    host = socket.gethostname()
    private = (one for _, one in addresses() if ipaddress.ip_address(one).is_private)
    names = (host, f"{host}.local", *private, *settings.names)
    return certificate_in(Path(settings.devices).parent, names)


async def _renew(context: ssl.SSLContext, settings: ConsoleSettings, door: Door) -> None:
    """For the connections from now on; where none can be made, the one before goes on.

    Not while a browser has the page open: it may have accepted that one, and would refuse another, PANIC too.
    """
    served = -1
    while True:
        await asyncio.sleep(_NAMED_S)
        if len(door):
            continue
        with contextlib.suppress(OSError):
            path = await asyncio.to_thread(_certificate, settings)
            if (made := path.stat().st_mtime_ns) != served:
                context.load_cert_chain(path)
                served = made


async def _pulse(notifier: Notifier, health: ProcessHealthWriter) -> None:
    while True:
        notifier.ping(time.monotonic())
        health.publish_health(time.monotonic())
        await asyncio.sleep(_PULSE_S)


async def _refresh(box: BoxView, watchers: Watchers) -> None:
    while True:
        box.refresh()
        watchers.put_text(box.text)
        await asyncio.sleep(_REFRESH_S)


async def _send_frames(stage: StageView, watchers: Watchers) -> None:
    while True:
        if watchers.frames_wanted:
            frame = stage.newest(time.monotonic())
            if frame is not None:
                watchers.put_frame(frame, stage.with_ghost)
            await asyncio.sleep(TICK_S * watchers.every)
        else:
            stage.state(time.monotonic())
            await asyncio.sleep(_IDLE_S)
