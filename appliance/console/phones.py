"""Phones in place of wearables: who may be which sensor, and what a phone sends.

A phone sends by a WebSocket where one opens, else by POST requests: Safari refuses a WebSocket to a
certificate that is not a public one, where it accepts the page itself. Both carry the same messages.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import secrets
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web

from appliance.box.door import Door as Entrance
from appliance.box.fallback import Fallbacks
from appliance.console.body import said
from appliance.console.devices import WrongPins
from appliance.console.fallback import PHONE_REFUSED
from appliance.console.guard import Guard, peer
from appliance.console.join_codes import VALID_S, JoinCodes
from appliance.pose.foreign_file import plain_json
from appliance.pose.turns import UNTURNED, Vector, multiplied
from appliance.sensor.foreign.door import Door
from appliance.sensor.foreign.foreign_sensor import ForeignSensor
from appliance.sensor.foreign.orientations import facing_front, from_device_angles
from appliance.sensor.wire import BATTERY_UNKNOWN

AWAY_S = 5.0  # a phone that is silent for this long loses its place
MOST_A_SECOND = 200  # messages of a phone, which measures 60 times a second; beyond it few are read
_CLOSEST_S = 0.01  # between two that are read beyond it
# The axis of the phone that points to the front in the neutral pose: x to the right of the upright screen, y
# to its top edge, z out of it. At the left arm the screen faces outwards with its top edge up.
FRONTS: dict[str, Vector] = {
    "left-arm": (-1.0, 0.0, 0.0),
    "right-arm": (1.0, 0.0, 0.0),
    "hand": (0.0, 1.0, 0.0),
    "chest": (0.0, 0.0, 1.0),
}
_FLOOD_S = 0.001
_TURN_S = 0.2
_ANSWER_EACH_S = 0.2
_LONGEST_MESSAGE = 512  # bytes
_SILENT_SOCKET_S = 10.0
_FARTHEST = 1000.0  # degrees
_CLOCK_STEP_MS = 1000.0  # a phone's clock that runs back by more was set; by less, two messages overtook
_NO_CODE = (
    "This code is not valid: each is for one phone and for a quarter of an hour. Ask for another one, on the "
    "page Sensors or by: bunraku console phone {name}"
)


class _PhoneSensor:
    """One sensor, and the phone that is it now. session: "" while no phone is."""

    def __init__(self, name: str, door: Door) -> None:
        self.sensor = ForeignSensor(name, "phone", door)
        self.session, self.owner, self.token = "", "", ""
        self.front = UNTURNED
        self.counts: Counter[str] = Counter()
        self._heard = self._clock = self._second = -math.inf
        self._in_second = 0
        self._taps = 0.0

    @property
    def name(self) -> str:
        return self.sensor.name

    def is_taken(self, now: float) -> bool:
        """Whether a phone is this sensor, and was heard lately."""
        return bool(self.session) and now - self._heard < AWAY_S

    def give(self, owner: str, token: str, front: Vector, now: float) -> str:
        """Let a phone be it from now on; its session. To the stage that is a sensor that was switched on.

        owner: a device's id, or "pass" with the pass as token.
        """
        self.session, self.owner, self.token = secrets.token_hex(16), owner, token
        self.front = facing_front(front)
        self._heard, self._clock, self._taps = now, -math.inf, 0.0
        self.sensor.switch_on()
        return self.session

    def hear(self, message: dict[str, Any], now: float, skipped: int) -> str:
        """Take a message; what is wrong with it, in one word of the page, or "".

        skipped: messages before it that were too close to each other to be read.
        """
        if now - self._second >= 1.0:
            self._second, self._in_second = now, 0
        self._in_second += 1 + skipped
        is_flood = self._in_second > MOST_A_SECOND
        if is_flood:
            self.counts["too_fast"] += 1 + skipped
            if now - self._heard < _CLOSEST_S:
                return "too_fast"
        self._heard = now
        reported = _numbers([message.get("t"), message.get("taps", 0)], 1e15)
        if len(reported) != 2:
            return self._refuse("no_numbers")
        clock, taps = reported
        if taps != self._taps:
            self._taps = taps
            self.sensor.taps += 1
        runs_back = self._clock - clock >= _CLOCK_STEP_MS
        if clock <= self._clock and not runs_back:
            self.counts["late"] += 1
            return ""
        self._clock = clock
        if "turned" not in message:
            return ""
        angles = _numbers(message["turned"], _FARTHEST)
        if len(angles) != 3:
            return self._refuse("no_numbers")
        battery = message.get("battery")
        level = battery if type(battery) is int and 0 <= battery <= 100 else BATTERY_UNKNOWN
        self.sensor.take(multiplied(from_device_angles(*angles), self.front), now, level)
        if runs_back:
            return self._refuse("clock_back")
        return "too_fast" if is_flood else ""

    def _refuse(self, why: str) -> str:
        """Count it."""
        self.counts[why] += 1
        return why

    def turn(self, now: float) -> None:
        """Hear the stage, and forget a phone that is away."""
        self.sensor.turn(now)
        if self.session and not self.is_taken(now):
            self.session = ""


class Phones:
    """Routes for phones. names: the sensors that phones may be; folder: where the box's processes meet.

    A phone may be a sensor when its device gave the PIN, or by a code, or by the pass that the code became.
    """

    def __init__(
        self, guard: Guard, entrance: Entrance, names: Sequence[str], folder: Path, fallbacks: Fallbacks
    ) -> None:
        door = Door(folder)
        self._guard, self._entrance, self._fallbacks = guard, entrance, fallbacks
        self._phones = {name: _PhoneSensor(name, door) for name in names}
        self._codes, self._wrong = JoinCodes(folder), WrongPins()
        with contextlib.suppress(OSError):
            self._codes.set_names(names)

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/phones", self._list),
            web.post("/api/phones/code", self._new_code),
            web.post("/api/phones/join", self._join),
            web.post("/api/phones/reading", self._reading),
            web.post("/api/phones/leave", self._leave),
            web.get("/api/phones/live", self._live),
        ]

    async def watch(self) -> None:
        """Hear the stage all the time, so that a lamp changes while a phone only listens."""
        while True:
            now = time.monotonic()
            for phone in self._phones.values():
                if phone.session and not self._is_allowed(phone):
                    phone.session = ""  # the PIN was changed, or its device revoked
                phone.turn(now)
            await asyncio.sleep(_TURN_S)

    def close(self) -> None:
        for phone in self._phones.values():
            phone.sensor.close()

    async def _list(self, request: web.Request) -> web.Response:
        now = time.monotonic()
        return web.json_response(
            [
                {"name": name, "taken": phone.is_taken(now), "counts": dict(phone.counts)}
                for name, phone in self._phones.items()
            ]
        )

    async def _new_code(self, request: web.Request) -> web.Response:
        """{"name"} of a sensor -> a code, and the squares of a QR code of its address, row by row."""
        values = await said(request)
        phone = self._phone(values.get("name"))
        try:
            code = self._codes.new_code(phone.name, time.monotonic())
        except (KeyError, OSError):
            raise web.HTTPServiceUnavailable(
                text="No code can be kept in the runtime folder. Free memory there."
            ) from None
        from appliance.console.phone_address import address_here, squares

        address = address_here(request.scheme, request.host, phone.name, code)
        return web.json_response({"address": address, "seconds": VALID_S, "squares": squares(address)})

    async def _join(self, request: web.Request) -> web.Response:
        """{"name", "where", "code" or "pass", "take_over"} -> {"session", "pass"}."""
        values = await said(request)
        phone, where = self._phone(values.get("name")), values.get("where")
        if not isinstance(where, str) or where not in FRONTS:
            raise web.HTTPBadRequest(text=f"A phone is worn as one of: {', '.join(FRONTS)}.")
        now = time.monotonic()
        device = self._guard.device(request)
        token = values.get("pass")
        is_own = isinstance(token, str) and self._codes.is_pass(phone.name, token)
        owner = device.id if device is not None else "pass" if is_own else "code"
        if phone.is_taken(now) and owner != phone.owner and values.get("take_over") is not True:
            raise web.HTTPConflict(
                text=f"Another phone is {phone.name} now. Close its page, or take its place."
            )
        if owner == "code":
            token, owner = self._use_code(request, phone.name, values.get("code"), now), "pass"
        self._know(request)
        own = token if owner == "pass" and isinstance(token, str) else ""
        session = phone.give(owner, own, FRONTS[where], now)
        return web.json_response({"session": session, "pass": own})

    def _is_allowed(self, phone: _PhoneSensor) -> bool:
        """Whether the phone that is this sensor may still be it."""
        if phone.owner == "pass":
            return self._codes.is_pass(phone.name, phone.token)
        return self._guard.remembers(phone.owner)

    def _use_code(self, request: web.Request, name: str, code: object, now: float) -> str:
        """The pass for a code. Raises 401 without one, 403 for a wrong one, 429 after too many of these."""
        if not isinstance(code, str) or not code:
            raise web.HTTPUnauthorized(
                text=f"To be {name} this phone needs a code, or the PIN. The technician has both."
            )
        asker = peer(request)
        if wait_s := self._wrong.wait_s(asker, now):
            headers = {"Retry-After": str(math.ceil(wait_s))}
            raise web.HTTPTooManyRequests(text="Too many wrong codes. Wait a minute.", headers=headers)
        try:
            token = self._codes.use(name, code[:64], time.monotonic())
        except OSError:
            raise web.HTTPServiceUnavailable(
                text="No phone can be noted in the runtime folder. Free memory there."
            ) from None
        if not token:
            self._wrong.note(asker, now)
            raise web.HTTPForbidden(text=_NO_CODE.format(name=name))
        self._wrong.forget(asker)
        return token

    async def _reading(self, request: web.Request) -> web.Response:
        values = await said(request)
        phone = self._of_session(values.get("session"))
        if phone is None:
            raise web.HTTPGone(text="This phone is no sensor any more: another one is, or it was away.")
        self._know(request)
        return web.json_response(self._hear(phone, values))

    async def _leave(self, request: web.Request) -> web.Response:
        """The page is closed: nothing more is sent, and the stage gives the joint back."""
        phone = self._of_session((await said(request)).get("session"))
        if phone is not None:
            phone.session = ""
        return web.json_response({"done": phone is not None})

    async def _live(self, request: web.Request) -> web.StreamResponse:
        """The same by a WebSocket; answers come when something changed, and five times a second."""
        socket = web.WebSocketResponse(
            max_msg_size=_LONGEST_MESSAGE, compress=False, receive_timeout=_SILENT_SOCKET_S, timeout=1.0
        )
        await socket.prepare(request)
        newest: dict[str, Any] = {}
        answered_at = heard_at = -math.inf
        skipped = 0
        with contextlib.suppress(TimeoutError, ConnectionError):
            async for message in socket:
                now = time.monotonic()
                if now - heard_at < _FLOOD_S and answered_at > -math.inf:
                    skipped += 1  # a flood costs no more than this
                    continue
                heard_at = now
                values = _object(message.data) if message.type == WSMsgType.TEXT else None
                phone = None if values is None else self._of_session(values.get("session"))
                if values is None or phone is None:
                    await socket.close(code=1008, message=b"no sensor of this page")
                    break
                self._know(request, watches=True)
                answer, skipped = self._hear(phone, values, skipped), 0
                if answer != newest or now - answered_at >= _ANSWER_EACH_S:
                    newest, answered_at = answer, now
                    await socket.send_str(json.dumps(answer))
        return socket

    def _hear(self, phone: _PhoneSensor, message: dict[str, Any], skipped: int = 0) -> dict[str, Any]:
        now = time.monotonic()
        if why := phone.hear(message, now, skipped):
            self._fallbacks.count(PHONE_REFUSED.name, now)
            troubled = [one.name for one in self._phones.values() if one.counts.keys() - {"late"}]
            self._fallbacks.concern(PHONE_REFUSED.name, troubled)
        return {"lamp": phone.sensor.lamp, "linked": phone.sensor.is_linked, "said": why}

    def _phone(self, name: object) -> _PhoneSensor:
        phone = self._phones.get(name) if isinstance(name, str) else None
        if phone is None:
            raise web.HTTPNotFound(
                text="No phone can be this sensor. The box file lists those that phones may be: "
                "sensors: foreign."
            )
        return phone

    def _of_session(self, session: object) -> _PhoneSensor | None:
        if not isinstance(session, str) or not session:
            return None
        given = session.encode(errors="replace")
        return next(
            (one for one in self._phones.values() if secrets.compare_digest(one.session.encode(), given)),
            None,
        )

    def _know(self, request: web.Request, watches: bool = False) -> None:
        """A phone that is a sensor is no stranger: its connection stays when the page is crowded."""
        if request.transport is not None:
            self._entrance.note_request(request.transport.get_extra_info("peername"), True, watches)


def _object(text: str) -> dict[str, Any] | None:
    try:
        found = plain_json(text)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _numbers(given: object, most: float) -> tuple[float, ...]:
    """The numbers of a list; () where it holds anything else, or one farther from zero than this."""
    if not isinstance(given, list):
        return ()
    found = tuple(one for one in given if type(one) in (int, float) and abs(one) <= most)
    return found if len(found) == len(given) else ()
