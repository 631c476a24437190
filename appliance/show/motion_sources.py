"""Sources of motion that the generator makes: their sections in show.yaml, and what cues change of them."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, field_validator, model_serializer

from appliance.levers.sources import GRANULAR, IMPROVISE, MOST_POINTS, PARAMETERS, PATH, VARY
from appliance.show.section import BundleFile, Section, key, refusal

_Share = Annotated[float, Field(ge=0, le=1)]


def _parameter(source: str, name: str, default: Any = ...) -> Any:
    """A key with the sentence and the bounds of the source's parameter."""
    about = PARAMETERS[source][name]
    first: Any = (int(about.default) if about.is_whole else about.default) if default is ... else default
    return Field(default=first, description=about.meaning, ge=about.least, le=about.most)


def _network(model: str) -> Any:
    """A key for the file of a model, which must be in the bundle where the source is."""
    meaning = f"File in the bundle that `bunraku train --model {model}` wrote."
    return Field(default=f"{model}.onnx", description=meaning, validate_default=True)


class GoesOnConfig(Section):
    """The puppet that cues lead goes on by itself: after a live dancer who stands still, or to a place."""

    network: BundleFile = _network("improviser")
    after_s: float = key(
        "How long a live dancer stands still, or is not heard, before the puppet goes on from what the "
        "dancer has just done, in seconds.",
        1.5,
        within=(0.5, 2.5),
    )
    temperature: float = _parameter(IMPROVISE, "temperature")
    top_p: float = key(
        "How much of what it might do next it considers: 1 all of it, 0.5 the likelier half.",
        0.95,
        within=(0.05, 1),
    )


class VaryConfig(Section):
    """The phrase danced anew at every return, by noise in a network that knows 2.6 s at once."""

    network: BundleFile = _network("sequence")
    sigma: float = _parameter(VARY, "sigma")
    seed: int = _parameter(VARY, "seed")


class GranularConfig(Section):
    """A dance without a phrase, or between two."""

    network: BundleFile = _network("sequence")
    from_: str | None = Field(
        default=None,
        alias="from",
        description="A phrase whose path is danced, instead of a walk.",
        max_length=64,
    )
    to: str | None = key("Another phrase, mixed into this one.", None, length=(1, 64))
    speed: float = _parameter(GRANULAR, "speed")
    spread: float = _parameter(GRANULAR, "spread")
    mix: float = _parameter(GRANULAR, "mix")
    from_start_s: float = _parameter(GRANULAR, "from_start_s")
    to_start_s: float = _parameter(GRANULAR, "to_start_s")
    seconds: float = _parameter(GRANULAR, "seconds")
    offset: float = _parameter(GRANULAR, "offset")
    seed: int = _parameter(GRANULAR, "seed")


class PathConfig(Section):
    """The phrase's path through the dancer's poses that wobbles, or a point or line by `/motion/path`."""

    network: BundleFile = _network("pose")
    by_hand: bool = key(
        "Whether the limb that the show's first hand holds points at the map while it holds: ahead is the "
        "middle, its left and right, up and down are the edges.",
        False,
    )
    wobble: float = _parameter(PATH, "wobble")
    frequency: float = _parameter(PATH, "frequency")
    seed: int = _parameter(PATH, "seed")


class ImproviseConfig(Section):
    """The dance goes on from what was just danced, move after move, and never comes back."""

    network: BundleFile = _network("improviser")
    temperature: float = _parameter(IMPROVISE, "temperature")
    seconds: float = _parameter(IMPROVISE, "seconds")
    seed: int = _parameter(IMPROVISE, "seed")


class _Changes(Section):
    """Keys that a cue leaves out stay as they are."""

    @model_serializer
    def _given(self) -> dict[str, Any]:
        return {
            name: getattr(self, name) for name in self.model_fields_set if getattr(self, name) is not None
        }


class VaryChanges(_Changes):
    """Parameters of the source vary."""

    sigma: float | None = _parameter(VARY, "sigma", None)
    seed: int | None = _parameter(VARY, "seed", None)


class GranularChanges(_Changes):
    """Parameters of the source granular."""

    speed: float | None = _parameter(GRANULAR, "speed", None)
    spread: float | None = _parameter(GRANULAR, "spread", None)
    mix: float | None = _parameter(GRANULAR, "mix", None)
    from_start_s: float | None = _parameter(GRANULAR, "from_start_s", None)
    to_start_s: float | None = _parameter(GRANULAR, "to_start_s", None)
    seconds: float | None = _parameter(GRANULAR, "seconds", None)
    offset: float | None = _parameter(GRANULAR, "offset", None)
    seed: int | None = _parameter(GRANULAR, "seed", None)


class PathChanges(_Changes):
    """Parameters of the source path."""

    points: list[_Share] | None = key(
        "x and y of a point of the map, or of each point of a line over it, as `/motion/path` takes them. "
        "[]: the phrase's own path.",
        None,
        length=(0, 2 * MOST_POINTS),
    )
    wobble: float | None = _parameter(PATH, "wobble", None)
    frequency: float | None = _parameter(PATH, "frequency", None)
    seed: int | None = _parameter(PATH, "seed", None)

    @field_validator("points")
    @classmethod
    def _in_pairs(cls, points: list[float] | None) -> list[float] | None:
        if points is not None and len(points) % 2:
            raise refusal("The last of the points has no y.", "Write x and y of each point.")
        return points


class ImproviseChanges(_Changes):
    """Parameters of the source improvise."""

    temperature: float | None = _parameter(IMPROVISE, "temperature", None)
    seconds: float | None = _parameter(IMPROVISE, "seconds", None)
    seed: int | None = _parameter(IMPROVISE, "seed", None)


class MotionChanges(_Changes):
    """Parameters of the sources, reached over the cue's fade."""

    vary: VaryChanges | None = key("Settings of the source `vary`.", None)
    granular: GranularChanges | None = key("Settings of the source `granular`.", None)
    path: PathChanges | None = key("Settings of the source `path`.", None)
    improvise: ImproviseChanges | None = key("Settings of the source `improvise`.", None)
