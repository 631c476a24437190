"""The generator's process: one show after the other, until a signal comes."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from appliance.box.orders import OrderInbox
from appliance.box.own_process import OwnProcess
from appliance.box.realtime import give_way
from appliance.box.show_state import ShowStateReader
from appliance.box.watchdog import Patience, end_process, guarded
from appliance.generator.fallback import OF_THE_GENERATOR
from appliance.generator.generator import Generator, save_memory
from appliance.outputs.frame_reader import FrameReader
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show

_log = logging.getLogger(__name__)

_LOOK_S = 0.05
_NICE = 10
# A variation of a phrase of ten minutes takes some ten seconds on a small machine.
_PATIENCE_S, _HUNG = 30.0, 75


def run_generator(directory: Path | None, box_file: Path | None) -> None:
    """Make motion until a signal comes; without a folder, for the show that the stage dances.

    Raises ConfigError for a show or box file that is broken, RuntimeFolderError without a place to meet.
    """
    box = load_box(box_file)
    give_way(_NICE)
    save_memory()
    with OwnProcess(box, "generator", OF_THE_GENERATOR) as own:
        folder, stopped = own.folder, own.stopped
        stage, show_state = own.keep(FrameReader(folder)), own.keep(ShowStateReader(folder))
        inbox = own.keep(OrderInbox(folder, "generator"))
        patience = Patience(_PATIENCE_S)

        def pulse() -> None:
            patience.note_sign(time.monotonic())

        own.pulse(time.monotonic())
        own.opened.enter_context(guarded(patience, lambda: False, _give_up, is_well=own.pulse))
        own.notifier.ready("The generator makes what the stage asks for.")
        while not stopped():
            pulse()
            stage.newest(time.monotonic())
            if directory is None and stage.facts is None:
                time.sleep(_LOOK_S)
                continue
            is_over = partial(_has_changed, stage, stage.generation, directory, stopped)
            try:
                show = load_show(directory or _facts_folder(stage))
            except ConfigError as error:
                _log.error(f"{error}\nNothing is made until the stage dances another show.")
                while not is_over():
                    pulse()
                    time.sleep(_LOOK_S)
                continue
            generator = Generator(show, box, folder, stage, own.fallbacks)
            with contextlib.closing(generator):
                _generate(generator, inbox, show_state, is_over, pulse)


def _give_up() -> None:
    end_process(
        f"Making a motion has taken {_PATIENCE_S:g} s. The last phrase plays on; the generator starts again.",
        _HUNG,
    )


def _generate(
    generator: Generator,
    inbox: OrderInbox,
    show_state: ShowStateReader,
    is_over: Callable[[], bool],
    pulse: Callable[[], None],
) -> None:
    while not is_over():
        generator.look(show_state, time.monotonic())
        while (order := inbox.take()) is not None:
            inbox.answer(order, *generator.obey(order))
        pulse()
        time.sleep(_LOOK_S)


def _has_changed(
    stage: FrameReader, generation: int, directory: Path | None, stopped: Callable[[], bool]
) -> bool:
    """Whether this show's time is over; keeps what is seen of the stage new."""
    stage.newest(time.monotonic())
    return stopped() or (directory is None and stage.generation != generation)


def _facts_folder(stage: FrameReader) -> Path:
    assert stage.facts is not None
    return stage.facts.show_directory
