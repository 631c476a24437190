"""`bunraku improvise` continues a prompt, or a recorded moment, by an improviser of the studio or a show."""

from __future__ import annotations

import logging
from dataclasses import asdict, replace

import numpy as np
from rich.console import Console

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.steps import floor_under
from appliance.levers.sources import IMPROVISE
from appliance.pose.recording import Recording
from appliance.studio.dance_files import write_dance
from appliance.studio.data.dataset import FPS, Dataset, window_starts
from appliance.studio.evaluation.coders import MovedJoints
from appliance.studio.improviser.improvise_options import ImproviseOptions
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.improviser.prompt import Follower, MovesFollower, continued
from appliance.studio.opened_model import open_show, say_if_dead
from appliance.studio.progress import logged
from appliance.studio.standing_dance import excerpt_of, only_in, standing
from appliance.studio.studio_error import StudioError

_log = logging.getLogger(__name__)

PROMPT_S = 3.0  # seconds of a recording, where an improviser that makes no endless phrase gets no prompt


def continue_of_show(options: ImproviseOptions) -> None:
    """The improviser of a show dances on after the prompt or the show's phrase. Raises StudioError."""
    assert options.show is not None
    console, opened = Console(stderr=True), open_show(IMPROVISE, options.show)
    network = opened.network
    assert isinstance(network, ImproviserNetwork)
    say_if_dead(network, opened.dataset, console)
    if options.regions and options.prompt is None:
        options = replace(options, prompt=opened.phrase, prompt_end=options.prompt_end or PROMPT_S)
    follower = MovesFollower(network, network)
    with logged(console):
        continue_prompt(options, follower, network, opened.dataset, is_quick=True)


def continue_prompt(
    options: ImproviseOptions,
    follower: Follower,
    moves: MovedJoints,
    dataset: Dataset,
    is_quick: bool = False,
) -> None:
    """The prompt and what the improviser dances after it, with a report and a picture.

    Without a prompt it goes on from a recorded moment, which is cut away: the seed chooses it. is_quick: see
    standing.
    """
    end = 1e9 if options.prompt_end is None else options.prompt_end
    prompt = (
        _recorded_moment(dataset, options.phrase.seed)
        if options.prompt is None
        else excerpt_of(options.prompt, 0.0, end, moves, dataset, options.reading)
    )
    asked = options.phrase
    _log.info("dancing on after the prompt, and planting the feet ...")
    made = continued(follower, dataset, prompt, asked.seconds, asked.temperature, asked.seed, is_quick)
    figures = {"joined_s": made.joined_s, "seam_degrees": made.seam, "usual_degrees": made.usual}
    dance, message = made.dance, f"the prompt ends at {made.joined_s:.1f} s"
    if options.regions:
        dance = _in_regions(dance, options, moves, dataset, is_quick)
        figures, message = {}, f"{' and '.join(options.regions)} only, from {made.joined_s:.1f} s on"
    elif options.prompt is None:
        dance, figures, message = dance.excerpt(made.joined_s), {}, "after a recorded moment"
    _log.info("measuring the dance and the recordings, and drawing the strip ...")
    natural = measure(dance, Yardstick.of(dataset.training, dataset.moving), endless=False)
    report = {"phrase": asdict(asked), **figures, "naturalness": natural.as_json()}
    write_dance(options.out, dance, f"{options.out.stem}: {message}", report, rows=3)
    seam = (
        f" The largest step of a joint around there is {made.seam:.1f} degrees, {made.usual:.1f} are usual "
        "in the prompt."
    )
    Console().print(naturalness_table({options.out.stem: natural}))
    _log.info(f"{options.out}: {dance.seconds:.1f} s; {message}.{seam if figures else ''}")


def _in_regions(
    dance: Recording, options: ImproviseOptions, moves: MovedJoints, dataset: Dataset, is_quick: bool
) -> Recording:
    """The whole prompt, on its own way, with the regions of the improvisation. Raises StudioError."""
    assert options.prompt is not None, "the command asks for it"
    phrase = excerpt_of(options.prompt, 0.0, dance.seconds, moves, dataset, options.reading)
    if len(phrase) < len(dance) - 1 and options.prompt_end is None:
        raise StudioError(
            f"{options.prompt} ends where the improvisation begins. Give an earlier --from, so that the rest "
            "of the body has a dance to go on with."
        )
    poses = dance.poses[: len(phrase), list(dataset.moving)].astype(np.float32)
    return standing(only_in(options.regions, poses, phrase, dataset), phrase, dataset, is_quick=is_quick)


def _recorded_moment(dataset: Dataset, seed: int) -> Recording:
    """A few seconds of a training take, its floor at height 0."""
    rng, frames = np.random.default_rng(seed), round(PROMPT_S * FPS)
    starts = [(take, first) for take in dataset.training for first in window_starts(take, window=frames)]
    if not starts:
        raise StudioError(f"No recording has {PROMPT_S:g} s without a capture error. Give a --prompt.")
    take, first = starts[int(rng.integers(len(starts)))]
    moment = take.recording.excerpt(first / FPS, (first + frames) / FPS)
    roots = moment.roots.copy()
    roots[:, 1] -= floor_under(moment)
    return replace(moment, roots=roots)
