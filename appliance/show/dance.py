"""The sections of show.yaml about the puppet and its motion source."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from appliance.levers.sources import GRANULAR, IMPROVISE, LIVE, MADE, MAIN, PATH, SEEDS, VARY
from appliance.show.config_error import did_you_mean
from appliance.show.motion_sources import (
    GoesOnConfig,
    GranularConfig,
    ImproviseConfig,
    PathConfig,
    VaryConfig,
)
from appliance.show.section import BundleFile, Section, key, refusal

Blending = Literal["prompt", "hann"]


class DancerConfig(Section):
    """The puppet: which network dances, and how often it goes over a window."""

    network: BundleFile = key("The network's file in the bundle.", "puppet.onnx")
    coding_iterations: int = key(
        "How often encode and decode run on each window. "
        "More: away from the phrase, towards the dancer's habits; and more time for each tick.",
        10,
        within=(1, 64),
    )
    interaction_iterations: int = key(
        "In how many of those, counted from the first, the held joints are overwritten; at most "
        "coding_iterations. Equal to it: the output shows the held orientation itself. "
        "Default: one less than coding_iterations (but at least 1), so the last pass is free.",
        9,
        within=(0, 64),
    )
    liveliness: float = key(
        "How much of the phrase's own movement stays while a hand holds. 1: as lively as the dancer; 0: the "
        "calm answer, without noise.",
        1.0,
        within=(0, 1),
    )
    seed: int | None = key(
        "Seed of the noise in the answer to a hand. The same seed and the same hand give the same dance, so "
        "every evening is as rehearsed. null: a new seed at each start of the show, reported by status and "
        "journal. A show that continues after a crash or a power cut keeps its seed.",
        0,
        within=(0, SEEDS - 1),
    )
    hop: int = key(
        "Ticks from one window to the next; they are blended. More spare the processor, but a hand's motion "
        "gets jerky: at 4 its jolts are five times as large.",
        1,
        within=(1, 8),
    )
    blending: Blending = key(
        "How windows are blended. `prompt`: half of a step of the hand reaches the output within 20 ms. "
        "`hann`: as in the papers, after 60 ms, but smoother; better from about 30 iterations on.",
        "prompt",
    )

    @model_validator(mode="before")
    @classmethod
    def _last_pass_is_free(cls, values: Any) -> Any:
        if isinstance(values, dict) and "interaction_iterations" not in values:
            iterations = values.get("coding_iterations")
            if isinstance(iterations, int):
                return {**values, "interaction_iterations": min(max(iterations - 1, 1), 64)}
        return values

    @field_validator("interaction_iterations")
    @classmethod
    def _at_most_coding_iterations(cls, value: int, info: ValidationInfo) -> int:
        coding_iterations = info.data.get("coding_iterations")
        if coding_iterations is not None and value > coding_iterations:
            raise refusal(
                f"interaction_iterations ({value}) is more than coding_iterations ({coding_iterations}).",
                f"Write 0 to {coding_iterations}; {max(coding_iterations - 1, 1)} leaves the last pass free.",
            )
        return value


class MotionConfig(Section):
    """The puppet's motion source: playback of a phrase."""

    phrase: BundleFile = key(
        "The bundle's file with the phrase that the show starts with; cues and `/phrase` call it `main`.",
        "phrase.bvh",
    )
    phrases: dict[str, BundleFile] = key(
        "Further phrases of the same skeleton, each with the name that cues and `/phrase` call "
        "it by, like `quiet: quiet.bvh`. They play from start to end.",
        {},
        length=(0, 32),
    )
    live: bool = key(
        "Whether a live dancer's motion capture may take the phrase's place: cues and `/phrase` call it "
        "`live`. docs/osc.md lists the programs that may send it.",
        False,
    )
    vary: VaryConfig | None = key("The source `vary`: the phrase danced anew at every return.", None)
    granular: GranularConfig | None = key(
        "The source `granular`: a walk through the dancer's movement.", None
    )
    path: PathConfig | None = key("The source `path`: a path through the dancer's poses that wobbles.", None)
    improvise: ImproviseConfig | None = key(
        "The source `improvise`: continues from what was just danced, and never returns.", None
    )
    goes_on: GoesOnConfig | None = key(
        "Lets the puppet go on by itself: after a live dancer who stands still, and to `/goal`.", None
    )
    kept: list[Annotated[str, Field(min_length=1, max_length=64)]] = key(
        "Names of motions saved on the box (`/motion/keep`) that cues of this show call. Until "
        "one is there the last phrase plays on.",
        [],
        length=(0, 16),
    )
    source: str = key(
        "Motion at the start: `main`, a name under phrases, `live`, `vary`, `granular`, `path` or "
        "`improvise`. The phrase plays until the motion is ready.",
        MAIN,
        length=(1, 64),
    )
    start_s: float = key("Start of the excerpt in `phrase`, in seconds.", 0.0, within=(0, 86400))
    end_s: float | None = key(
        "Its end, in seconds; after start_s. null: the phrase's end.", None, above=0, most=86400
    )
    rate: float = key(
        "Speed of playback: 1 as recorded, 0 stands still, below 0 runs backwards.", 1.0, within=(-4, 4)
    )
    crossfade_s: float = key(
        "Seconds of cross-fade from a loop's end to its start, and from one phrase to another "
        "where no fade is given.",
        0.5,
        within=(0, 5),
    )
    grounded: bool = key("Keep the lowest foot on the floor after the puppet has changed the legs.", True)

    @model_validator(mode="after")
    def _names_that_are_there(self) -> MotionConfig:
        for place, name in enumerate(self.kept):
            if self.sources.count(name) > 1 or name in (LIVE, *MADE):
                cure = "Keep the motion by another name."
                raise refusal(f"'{name}' names something else too.", cure, at=("kept", place))
            if not self.made_sources:
                cure = "Add `vary`, `granular`, `path` or `improvise` under motion."
                raise refusal("A show without a source that is made ahead has no generator.", cure, at="kept")
        if self.source not in self.sources:
            raise refusal(
                f"The show starts from '{self.source}', which it does not have.",
                did_you_mean(self.source, self.sources),
                at="source",
            )
        ends = {"from": self.granular.from_, "to": self.granular.to} if self.granular else {}
        for end, phrase in ends.items():
            if phrase is not None and phrase not in self.files:
                raise refusal(
                    f"There is no phrase '{phrase}' to walk along.",
                    did_you_mean(phrase, list(self.files)),
                    at=("granular", end),
                )
        return self

    @field_validator("phrases")
    @classmethod
    def _names_that_can_be_called(cls, phrases: dict[str, str]) -> dict[str, str]:
        for name in phrases:
            if name in (MAIN, LIVE, *MADE):
                what = {MAIN: "phrase that the show starts with", LIVE: "stream of motion capture"}
                raise refusal(
                    f"'{name}' is what the {what.get(name, 'source of motion')} is called.",
                    "Give this one another name.",
                    at=name,
                )
            if not 0 < len(name) <= 64:
                raise refusal(
                    "A phrase's name has 1 to 64 characters.", "Write it like `quiet: quiet.bvh`.", at=name
                )
        return phrases

    @property
    def sources(self) -> tuple[str, ...]:
        """The puppet's possible motion sources, by the names that cues call, the first one at the start
        first.
        """
        return (*self.files, *([LIVE] if self.live else []), *self.made_sources, *self.kept)

    @property
    def made_sources(self) -> dict[str, VaryConfig | GranularConfig | PathConfig | ImproviseConfig]:
        """The sources that the generator makes, by name."""
        sections = {
            VARY: self.vary,
            GRANULAR: self.granular,
            PATH: self.path,
            IMPROVISE: self.improvise,
        }
        return {name: section for name, section in sections.items() if section is not None}

    @property
    def files(self) -> dict[str, str]:
        """All phrases by their names, the one that the show starts with first."""
        return {MAIN: self.phrase, **self.phrases}

    @field_validator("end_s")
    @classmethod
    def _after_start(cls, value: float | None, info: ValidationInfo) -> float | None:
        start_s = info.data.get("start_s")
        if value is not None and start_s is not None and value <= start_s:
            raise refusal(
                f"end_s ({value:g}) is not after start_s ({start_s:g}).", "Write a later end, or null."
            )
        return value
