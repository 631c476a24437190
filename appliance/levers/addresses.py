"""All addresses that the box takes: those that set levers, those that do something once, and questions."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from appliance.levers.form import FADE, FAR, Form, Number
from appliance.levers.lever import Lever
from appliance.levers.status import STATUS
from appliance.levers.table import AGAIN, LEVERS, LOOK_FADE_S, STOP_FADE_S, VELOCITY

Receiver = Literal["stage", "projector", "lights", "generator"]

_ANY = -FAR, FAR
_ON = Number("0 or 1", 0, 1, is_whole=True)
_SECOND = Number("second", 0, FAR)
_CORNER = Number("corner", 1, 4, is_whole=True)
_PLACE = (Number("x", -0.5, 1.5), Number("y", -0.5, 1.5))  # as far as keys move a corner
_METRES = tuple(Number(f"{axis} in metres", *_ANY) for axis in "xyz")
_WAY = (Number("dx", -1, 1), Number("dy", -1, 1))
_SENSOR = Form("sensor", may_be_nameless=True)


class Address(NamedTuple):
    """An address, what it takes and does.

    lever: that it sets; order: of which receiver it orders what, once. With neither, show control has a
    function for it. arguments: for people, where the form's words are too long; fade_s: how long it takes
    where no fade is given.
    """

    address: str
    form: Form
    does: str
    lever: Lever[Any] | None = None
    order: tuple[Receiver, str] | None = None
    arguments: str = ""
    fade_s: float | None = None


def _of(lever: Lever[Any]) -> Address:
    return Address(lever.address, lever.form, lever.does, lever, fade_s=lever.fade_s)


def _once(receiver: Receiver, name: str, address: str, does: str, *numbers: Number, **more: Any) -> Address:
    form = more.pop("form", Form(numbers=numbers))
    return Address(address, form, does, order=(receiver, name), **more)


def _levers_at(*prefixes: str) -> tuple[Address, ...]:
    return tuple(_of(one) for one in LEVERS if one.address.startswith(prefixes))


_PLAYBACK, _MOTION = ("/player/",), ("/motion/",)

THE_SHOW = (
    Address(
        "/go",
        Form(numbers=(_ON,), optional=1),
        "the show goes on: lifts stop and panic, picture and lights come back over a second",
        arguments="[1]",
    ),
    Address(
        "/stop",
        Form(numbers=(FADE,), optional=1),
        "picture and lights fade out, then the phrase stands still until `/go`, whatever `/player` commands "
        "say. Sent again, it starts a new fade from the present level; `/stop 0` does not interrupt a fade",
        fade_s=STOP_FADE_S,
    ),
    Address(
        "/panic",
        Form(numbers=(_ON,), optional=1),
        "black at once: lights show their safe look, and the dance goes on unseen. Any argument means panic, "
        "except a single 0 (a button that was released), which is ignored. `/go` lifts it",
        arguments=" ",
    ),
    Address("/blackout", Form(numbers=(_ON,)), "dark, or not; the dance goes on"),
    Address(
        "/cue",
        Form("cue", may_be_nameless=True),
        "calls up a cue of `show.yaml`; left out: the next one of the list. A number calls the cue that is "
        'called so (`name: "12"`), not the twelfth one',
    ),
    *(one for one in map(_of, LEVERS) if one.address and not one.address.startswith(_PLAYBACK + _MOTION)),
    Address(
        "/camera/look",
        Form(numbers=(FADE,), optional=1),
        "the camera goes back to the look's own place",
        fade_s=LOOK_FADE_S,
    ),
    _once("stage", "kick", "/springs/kick", "every mass gets this velocity at once", *VELOCITY),
    _once(
        "lights",
        "walk",
        "/lights/walk",
        "while the show is stopped: each attribute of each fixture moves for three seconds, and "
        "only that fixture is lit. `/go`, `/panic` and `/blackout` end it",
        form=Form("fixture", may_be_nameless=True),
        arguments="[fixture; left out: the whole rig]",
    ),
    _once("lights", "walk/stop", "/lights/walk/stop", "ends the walk"),
    _once(
        *("stage", "pair/back", "/pair/back"),
        "the other box of the [pair](pair.md) leads from the next frame on; refused while it is not ready",
    ),
    Address("/ping", Form(), "`/pong` comes back"),
)
PLAYBACK = (
    Address("/player/start", Form(), "playback at the show's rate"),
    Address(
        "/player/stop",
        Form(),
        "playback stands still until `/player/start`, `/player/rate` or `/go`; the puppet goes on",
    ),
    _once("stage", "jump", "/player/jump", "go to this place of the phrase", _SECOND),
    *_levers_at(*_PLAYBACK),
    _once(
        "stage",
        "excerpt",
        "/player/excerpt",
        "play this part of the phrase; without end: to the phrase's end",
        form=Form(numbers=(Number("start", 0, FAR), Number("end", 0, FAR)), optional=1),
        arguments="start, [end], in seconds",
    ),
    _once(
        "stage",
        "hold",
        "/mocap/setjointrot",
        "hold a joint that an `osc` hand of the show has: axis in the parent's frame and angle in radians; "
        "joint by name or number",
        form=Form("joint", tuple(Number(axis, *_ANY) for axis in ("x", "y", "z", "angle"))),
    ),
    _once(
        "stage",
        "place",
        "/mocap/setjointpos",
        "hold a joint whose `osc` hand says `by: position` at this place in the room, in metres, y upwards, "
        "as `/mocap/0/joint/pos_world` has it. With seconds (0.1 to 3600): it is let go after so long "
        "without another place",
        form=Form("joint", (*_METRES, Number("seconds", 0.1, 3600)), optional=1),
        arguments="joint, x, y, z, [seconds]",
    ),
    _once("stage", "release", "/mocap/releasejoint", "give it back to the puppet", form=Form("joint")),
)
PROJECTOR = (
    _once(
        *("projector", "corner", "/projector/corner", "pulls one corner of the picture there"),
        *(_CORNER, *_PLACE),
        arguments="1 to 4, x, y",
    ),
    _once(
        *("projector", "corners", "/projector/corners", "all four"),
        *_PLACE * 4,
        arguments="x1, y1, x2, y2, x3, y3, x4, y4",
    ),
    _once(
        "projector",
        "nudge",
        "/projector/nudge",
        "moves one corner by these shares, -1 to 1; the reply says where it is now",
        *(_CORNER, *_WAY),
        arguments="1 to 4, dx, dy",
    ),
    _once(
        "projector", "corners/reset", "/projector/corners/reset", "the whole picture again, without a mesh"
    ),
    _once(
        "projector",
        "warp",
        "/projector/warp",
        "pulls one point of the 5 by 5 mesh by these shares; the corners are `/projector/corner`'s",
        *(Number("point", 1, 25, is_whole=True), *_WAY),
        arguments="1 to 25 row by row, dx, dy",
    ),
    _once("projector", "warp/reset", "/projector/warp/reset", "no mesh any more; the corners stay"),
    _once(
        *(
            "projector",
            "brightness",
            "/projector/brightness",
            "brightness of this projector; 1: as it is drawn",
        ),
        Number("brightness", 0, 2),
    ),
    _once(
        "projector",
        "overlap",
        "/projector/overlap",
        "with `edge_blend`: the share of this display that the other projector lights too",
        Number("overlap", 0.01, 0.5),
    ),
    _once(
        "projector",
        "blend_gamma",
        "/projector/blend_gamma",
        "with `edge_blend`: this projector's gamma",
        Number("gamma", 1, 3),
    ),
    _once("projector", "mirror", "/projector/mirror", "rear projection", _ON),
    _once("projector", "grid", "/projector/grid", "a grid for focus and corners", _ON),
    _once(
        "projector",
        "info",
        "/projector/info",
        "figures for technicians over the picture, the page's address and its PIN",
        _ON,
    ),
    _once(
        "projector",
        "test_card",
        "/projector/test_card",
        "the test card in place of the dance: focus, edges, greys, colours, the page's address and its PIN",
        _ON,
    ),
)
SENSORS = (
    _once(
        *("stage", "neutral", "/sensors/neutral", "take the neutral pose at the next stillness"),
        form=_SENSOR,
        arguments="[sensor; left out: all of the show]",
    ),
    _once(
        *("stage", "heading", "/sensors/heading", "where the dancer faces now is the front"),
        form=_SENSOR,
        arguments="[sensor; left out: all of the show]",
    ),
    _once("stage", "strobe", "/sensors/strobe", "its light flashes for 10 s", form=Form("sensor")),
    _once(
        *("stage", "reload", "/sensors/reload"),
        "reread the key file: new sensors may join, removed ones are dropped at once",
    ),
    Address("/sensors/list", Form(), "tells the state of all sensors"),
)
GESTURES = (
    Address(
        "/gesture/record",
        Form("name", also="cue"),
        "the next three movements of a hand between stillnesses are a gesture: whenever it makes that one "
        "again, the cue is called",
    ),
    Address("/gesture/stop", Form(), "nothing is recorded"),
    Address("/gesture/forget", Form("name"), "the gesture calls nothing any more"),
    Address("/gesture/rename", Form("name", also="new name"), "gives it another name"),
)
MADE_AHEAD = (
    *(one for one in _levers_at(*_MOTION)),
    Address("/motion/again", Form(), "another seed, at once", AGAIN),
    _once(
        "generator",
        "keep",
        "/motion/keep",
        "keeps what is danced now: `/phrase` calls it by this name, also after the power was cut; cues too, "
        "where `show.yaml` lists it as `kept`",
        form=Form("name"),
    ),
)


class Question(NamedTuple):
    """answers: the address of each message that answers it, its type tags, and its arguments, for people."""

    address: str
    answers: tuple[tuple[str, str, str], ...]


def _listed(lever: Lever[Any]) -> Question:
    """The names that a show has for a lever, and which is in force."""
    question = f"/{lever.names[0]}"
    first = f"name, `{lever.none}` first" if lever.none else "name"
    return Question(question, ((f"{question}/{lever.listed}", ",si", f"{first}; 1: in force"),))


LISTS: dict[str, Lever[Any]] = {f"/{one.names[0]}": one for one in LEVERS if one.listed}
QUESTIONS = (
    Question("/status", ((f"{STATUS}/…", "", "one message for each field, as below"),)),
    Question("/cues", (("/cues/cue", ",si", "name; 1: in force"),)),
    Question(
        "/phrases",
        (("/phrases/phrase", ",si", "name; 1: in force; also of sources and kept motions"),),
    ),
    *map(_listed, LISTS.values()),
    Question(
        "/motion",
        (
            (
                "/motion/is",
                ",s…",
                "a parameter of the motion that is danced, if it was made ahead; its value, text or numbers",
            ),
            (
                "/motion/parameter",
                ",ssf",
                "source, parameter, and the value that it has or fades to; of all sources of the show",
            ),
        ),
    ),
    Question(
        "/hands",
        (
            (
                "/hands/hand",
                ",ssis",
                "joint; what holds it; 1: holds, 0: has let go; what the hand gives: `orientation` or "
                "`position`",
            ),
        ),
    ),
    Question(
        "/gestures",
        (
            ("/gestures/gesture", ",sss", "name; the cue that it calls; joint of its hand"),
            ("/gestures/recording", ",sii", "name; repetitions that have come; how many it takes"),
        ),
    ),
    Question(
        "/fallbacks",
        (
            (
                "/fallbacks/fallback",
                ",ssiiss",
                "name; process; how often; 1: in force; a sentence, as [below](#fallbacks); the sensors, "
                "receivers, wires or disk that it is about, empty where the box does not know",
            ),
        ),
    ),
)
ADDRESSES: dict[str, Address] = {
    one.address: one for one in (*THE_SHOW, *PLAYBACK, *PROJECTOR, *SENSORS, *GESTURES, *MADE_AHEAD)
}
NAMED: dict[str, str] = {  # questions for names, and the address that each of these names comes with
    one.address: answer for one in QUESTIONS for answer, tags, _ in one.answers if tags == ",si"
}
ANSWERS = frozenset(answer for question in QUESTIONS for answer, *_ in question.answers)
FORMS: dict[str, Form] = {
    **{address: one.form for address, one in ADDRESSES.items()},
    **{question.address: Form() for question in QUESTIONS},
}
