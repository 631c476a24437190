"""`bunraku sound`: the strings that the dance plays, on a sound card or into a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.cli.options import BoxFile, ChosenFile
from appliance.options.idle_options import refuse_idle
from appliance.release.choice import box_of
from appliance.show.asked_for import require_sound
from appliance.show.bundle import default_show_path, named_show
from appliance.stage.stage_error import StageError


def sound(
    context: typer.Context,
    recording: Annotated[
        Path | None, typer.Argument(help="With --file: a BVH recording, or the journal of a run.")
    ] = None,
    box: BoxFile = None,
    file: Annotated[Path | None, typer.Option(help="Render a recording into this WAV instead.")] = None,
    show: Annotated[
        Path | None, typer.Option(callback=named_show, help="Show bundle whose strings the file gets.")
    ] = None,
    chosen: ChosenFile = None,
) -> None:
    """Play the strings of the show that the stage dances, through the sound card."""
    if file is None and recording is None:
        refuse_idle(context, ("show",), "without --file: the show that the stage dances has its own strings")
        box = box_of(box, chosen)
        require_sound(box)
        from appliance.sound.run import run_sound

        run_sound(box, chosen is None)
        return
    if file is None or recording is None:
        raise StageError("A file needs both: bunraku sound dance.journal --file out.wav")
    from appliance.cli.pictures import load_dance
    from appliance.show.box import load_box
    from appliance.show.show import load_show
    from appliance.show.sound import SoundConfig, StringsConfig
    from appliance.sound.render_file import render_file

    strings = load_show(show or default_show_path()).config.strings or StringsConfig()
    if strings.of in ("hand", "couplings"):
        raise StageError(
            f"A file has one figure, which no hand holds: strings with `of: {strings.of}` would be silent. "
            "They play on the stage."
        )
    config = load_box(box).sound or SoundConfig()
    try:
        seconds = render_file(load_dance(recording).of_puppet(None), strings, config, file)
    except OSError as error:
        raise StageError(f"{file}: the sound cannot be written ({error.strerror}).") from error
    print(f"{seconds:.1f} s of sound, {config.channels} channels: {file}")
