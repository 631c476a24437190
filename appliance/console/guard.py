"""Guards each request: from which network, for which name, from which page, by which device."""

from __future__ import annotations

import ipaddress
from collections.abc import Awaitable, Callable, Sequence

from aiohttp import web

from appliance.box.door import Door
from appliance.box.served import OwnNames, plain_address
from appliance.console.devices import Device, Devices

COOKIE = "bunraku_device"
_READING = ("GET", "HEAD")
# Anybody may look, and nobody change anything without the PIN, but for these routes: a phone has a code.
_FOR_ANYBODY = frozenset(("/api/pin", "/api/phones/join", "/api/phones/reading", "/api/phones/leave"))
_FOR_DEVICES = frozenset(
    (
        *("/hands", "/api/box/file", "/api/cue/show.zip", "/api/devices", "/api/fleet", "/api/help.zip"),
        *("/api/learn", "/api/logs", "/api/update"),
    )
)
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' ws://{host} wss://{host}; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """Refuses with 403 and one sentence. viewers: networks that may look; names: the box's own.

    door: what lets connections in, and hears here which are of known devices.
    """

    def __init__(self, viewers: Sequence[str], names: Sequence[str], devices: Devices, door: Door) -> None:
        self._viewers = [ipaddress.ip_network(one) for one in viewers]
        self._names = OwnNames(names)
        self._devices, self._door = devices, door
        self.refused = 0

    @web.middleware
    async def check(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Let a request through, or refuse it."""
        if request.transport is not None:
            connection = request.transport.get_extra_info("peername")
            self._door.note_request(connection, self.device(request) is not None, _upgrades(request))
        if complaint := self._complaint(request):
            self.refused += 1
            return web.Response(status=403, text=complaint, headers=_HEADERS)
        try:
            if needs_device(request):
                self.require_device(request)
            response = await handler(request)
        except web.HTTPException as error:
            error.headers.update(_HEADERS)
            raise
        if not response.prepared:
            response.headers.update(_HEADERS)
            response.headers["Content-Security-Policy"] = _POLICY.format(host=request.host)
            response.headers.setdefault("Cache-Control", "no-store")
        return response

    def device(self, request: web.Request) -> Device | None:
        """The device that sent it, if it is remembered."""
        return self._devices.known(request.cookies.get(COOKIE, "")[:128])

    def remembers(self, device_id: str) -> bool:
        """Whether a device with this id is still remembered."""
        return any(one.id == device_id for one in self._devices.devices)

    def require_device(self, request: web.Request) -> Device:
        """Raise 401 for a device that has not given the PIN."""
        device = self.device(request)
        if device is None:
            self.refused += 1
            raise web.HTTPUnauthorized(text="This needs the PIN. The box says it: bunraku console pin.")
        return device

    def _complaint(self, request: web.Request) -> str:
        if not self._may_look(peer(request)):
            return "This device may not open the page. The box file lists those that may: `console: viewers`."
        if not self._names.has(request.host):
            return "The box does not know this name as its own. Use its address, or list the name."
        origin = request.headers.get("Origin")
        if origin is None and not _upgrades(request) and request.method in _READING:
            return ""
        if origin != f"{request.scheme}://{request.host}":
            return "This request comes from another page than the box's own."
        return ""

    def _may_look(self, address: str) -> bool:
        try:
            asker = ipaddress.ip_address(address)
        except ValueError:
            return False
        return asker.is_loopback or any(asker in network for network in self._viewers)


def needs_device(request: web.Request) -> bool:
    """Whether the route of a request is only for devices that gave the PIN."""
    resource = request.match_info.route.resource
    if resource is None:  # there is no such route
        return False
    if request.method in _READING:
        return resource.canonical in _FOR_DEVICES
    return resource.canonical not in _FOR_ANYBODY


def peer(request: web.Request) -> str:
    """The address that a request comes from."""
    return plain_address(request.remote or "")


def _upgrades(request: web.Request) -> bool:
    return request.headers.get("Upgrade", "").lower() == "websocket"
