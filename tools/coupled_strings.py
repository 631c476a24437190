"""Measures the strings that couplings play: `python -m tools.coupled_strings RECORDINGS [OUT.png]`.

RECORDINGS: as for `bunraku duet`. Each couple's dance is played by `strings: {of: couplings}`, 20 s of it.
Null products: each dancer beside one of another couple, beside its own partner ten seconds later, beside a
figure that stands still, and the body's own strings, which hear nothing of the other one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.skeleton import Skeleton
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.couplings import Couplings
from appliance.sound.instrument import Instrument
from appliance.studio.data.dataset import Take, load_folder
from appliance.studio.partner.couples import couples_of

Floats = NDArray[np.float32]
SECONDS, FPS = 20.0, 50
SOUND = SoundConfig(block=960)  # samples in a frame


def trail(take: Take) -> Floats:
    """Positions (N, J, 3) of the first SECONDS."""
    part = take.recording.excerpt(0.0, min(SECONDS, take.recording.seconds))
    positions, _ = part.skeleton.forward_kinematics(part.poses, part.roots)
    return np.asarray(positions, np.float32)


def played(
    skeleton: Skeleton, first: Floats, second: Floats, of: str, is_heard: bool
) -> tuple[Floats, float, int]:
    """Samples (N,), none where it is not heard; the mean share of the joints that have a string; and how many
    strings were struck.
    """
    strings = StringsConfig.model_validate({"of": of})
    made, couplings = Instrument(skeleton, strings, SOUND), Couplings(skeleton)
    made.level, sound, shares, strikes = 1.0, [], [], 0
    for tick in range(min(len(first), len(second))):
        puppets = tuple(PuppetFrame.of(len(skeleton)) for _ in range(2))
        puppets[0].positions[:], puppets[1].positions[:] = first[tick], second[tick]
        couplings.look(JointFrame(puppets, tick, tick / FPS))
        if of == "couplings":
            made.couple(couplings.shares, tick / FPS)
        else:
            made.dance(first[tick], tick / FPS)
        strikes += int((made._strikes > 0).sum())
        shares.append(float(couplings.shares[made.strings.bones[:, 1]].mean()))
        if is_heard:
            sound.append(made.render(SOUND.block)[:, 0])
        made._strikes[:] = 0.0
    return np.concatenate(sound or [np.zeros(0, np.float32)]), float(np.mean(shares)), strikes


def pairs(couples: Sequence[tuple[Floats, Floats]]) -> Iterator[tuple[str, list[tuple[Floats, Floats]], str]]:
    """Each row: its name, who dances with whom, and what the strings play."""
    yield "couples", list(couples), "couplings"
    others = [*couples[1:], couples[0]]
    strangers = [(one, two) for (one, _), (_, two) in zip(couples, others, strict=True)]
    yield "null: dancers of different couples", strangers, "couplings"
    later = [(one, np.roll(two, len(two) // 2, axis=0)) for one, two in couples]
    yield "null: couples, one of them ten seconds later", later, "couplings"
    still = [(one, np.repeat(one[:1], len(one), axis=0)) for one, _ in couples]
    yield "null: beside one who stands still", still, "couplings"
    yield "null: the body's own strings, couples", list(couples), "body"
    yield "null: the body's own strings, strangers", strangers, "body"


def main() -> None:
    """Print the table; draw a couple and strangers."""
    dataset = load_folder(Path(sys.argv[1]), ReadingOptions())
    couples = [
        (trail(one), trail(two)) for one, two in couples_of([*dataset.held_out, *dataset.training]).values()
    ]
    print("| who | joint coupled, mean | strings struck a minute |")
    print("|---|---|---|")
    heard = {}
    for name, who, of in pairs(couples):
        if len(sys.argv) > 2:
            heard[name], *_ = played(dataset.skeleton, *who[0], of, True)
        found = [played(dataset.skeleton, one, two, of, False) for one, two in who]
        minutes = sum(min(len(one), len(two)) for one, two in who) / FPS / 60
        struck = sum(strikes for *_, strikes in found) / minutes
        share = np.mean([share for _, share, _ in found])
        print(f"| {name} | {share:.3f} | {struck:.0f} |", flush=True)
    if len(sys.argv) > 2:
        draw(heard, Path(sys.argv[2]))


def draw(heard: dict[str, Floats], out: Path) -> None:
    """Spectrograms of the first couple's sound and of its nulls."""
    figure = Figure(figsize=(10, 8), layout="constrained")
    for axes, (name, sound) in zip(figure.subplots(4, 1, sharex=True), heard.items(), strict=False):
        axes.specgram(sound, NFFT=8192, Fs=SOUND.rate, noverlap=7168, vmin=-130, vmax=-40, cmap="magma")
        axes.set(ylim=(50, 2000), ylabel="hertz", title=name)
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    main()
