"""What dances: the sections of show.yaml about the puppet and about what it starts from."""

from __future__ import annotations

from typing import Any

from pydantic import Field, ValidationInfo, field_validator, model_validator

from appliance.show.section import BundleFile, Section, refusal

MAIN = "main"  # the phrase that the show starts with


class DancerConfig(Section):
    """The puppet: which network dances, and how often it goes over a window."""

    network: BundleFile = Field(default="puppet.onnx", description="The network's file in the bundle.")
    coding_iterations: int = Field(
        default=10,
        ge=1,
        le=64,
        description="How often encode and decode run on each window. "
        "More: away from the phrase, towards the dancer's habits; and more time for each tick.",
    )
    interaction_iterations: int = Field(
        default=9,
        ge=0,
        le=64,
        description="In how many of those, from the first on, the held joints are overwritten; at most "
        "coding_iterations. Equal to it: the output shows the held orientation itself. "
        "Left out: one less than coding_iterations (but at least 1), so the last pass is free.",
    )
    hop: int = Field(
        default=1, ge=1, le=8, description="Ticks from one window to the next; they are blended."
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
    """What the puppet starts from: playback of a phrase."""

    phrase: BundleFile = Field(
        default="phrase.bvh",
        description="The file in the bundle of the phrase that the show starts with; "
        "cues and `/phrase` call it `main`.",
    )
    phrases: dict[str, BundleFile] = Field(
        default_factory=dict,
        max_length=32,
        description="Further phrases of the same skeleton, each with the name that cues and `/phrase` call "
        "it by, like `quiet: quiet.bvh`. They are played from their start to their end.",
    )
    start_s: float = Field(
        default=0.0, ge=0, le=86400, description="Where in `phrase` the excerpt starts, in seconds."
    )
    end_s: float | None = Field(
        default=None,
        gt=0,
        le=86400,
        description="Where it ends, in seconds; after start_s. null: at the phrase's end.",
    )
    rate: float = Field(
        default=1.0,
        ge=-4,
        le=4,
        description="Speed of playback: 1 as recorded, 0 stands still, below 0 runs backwards.",
    )
    crossfade_s: float = Field(
        default=0.5,
        ge=0,
        le=5,
        description="How long a loop's end melts into its start, and one phrase into another where nobody "
        "says how long, in seconds.",
    )
    grounded: bool = Field(
        default=True, description="Keep the lowest foot on the floor after the puppet has changed the legs."
    )

    @field_validator("phrases")
    @classmethod
    def _names_that_can_be_called(cls, phrases: dict[str, str]) -> dict[str, str]:
        for name in phrases:
            if name == MAIN:
                raise refusal(
                    f"'{MAIN}' is what the phrase that the show starts with is called.",
                    "Give this one another name.",
                    at=name,
                )
            if not 0 < len(name) <= 64:
                raise refusal(
                    "A phrase's name has 1 to 64 characters.", "Write it like `quiet: quiet.bvh`.", at=name
                )
        return phrases

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
