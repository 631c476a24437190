"""A show goes from one box to another: over that one's page, by the PIN of it, which is given once."""

from __future__ import annotations

import json
import ssl
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp

from appliance.box.durable import private_folder, write_whole
from appliance.console.guard import COOKIE
from appliance.pose.foreign_file import stored_json

PASSES = "fleet.json"  # in the folder in which the page keeps things
TAKEN, REFUSED, UNREACHABLE, NEEDS_PIN = "taken", "refused", "unreachable", "pin"
_REACHED_WITHIN_S, _TAKEN_WITHIN_S = 5.0, 1000.0  # a show is sent, then checked
_LARGEST_ANSWER = 1 << 16
_WRONG_PIN = (401, 403, 429)
_ANOTHER = "Its certificate is not the one that it had. If it is the same box, give its PIN again."


class Neighbour(NamedTuple):
    """A box as avahi knows it. host: its name in the network; version: of its release."""

    name: str
    host: str
    address: str
    port: int
    version: str = ""
    scheme: str = "http"

    @property
    def origin(self) -> str:
        """Where its page is."""
        return f"{self.scheme}://{self.address}:{self.port}"

    @property
    def key(self) -> str:
        """By which passes are kept: its address may change."""
        return f"{self.host}:{self.port}"


class Pass(NamedTuple):
    """By which a box knows this one. token: as a browser's cookie; authority: PEM of that box's own authority
    where its page is HTTPS, and "" else. A box that had one is never spoken to without it again.
    """

    token: str
    authority: str = ""


class Passes:
    """The file of passes by `Neighbour.key`; only this user reads it."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def of(self, key: str) -> Pass | None:
        """None: that box needs its PIN first."""
        try:
            return Pass(*map(str, stored_json(self._path)[key]))
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def keep(self, key: str, one: Pass) -> None:
        """Raises OSError."""
        try:
            before = dict(stored_json(self._path))
        except (OSError, ValueError, TypeError):
            before = {}
        private_folder(self._path.parent)
        write_whole(self._path, json.dumps(before | {key: one}).encode(), private=True)


class Pushed(NamedTuple):
    """One of the four states above, and the box's own sentence."""

    state: str
    message: str = ""


async def push(to: Neighbour, packed: Path, passes: Passes, pin: str, own_name: str) -> Pushed:
    """Send a packed show. pin: of that box, where there is no pass yet or it is no longer valid.

    The other box checks the show as one from a stick, and has taken all of it or nothing. Never raises.
    """
    try:
        known = passes.of(to.key)
        if pin or known is None:
            authority = await _authority(to)
            if not pin:
                return Pushed(NEEDS_PIN)
            async with _session(authority) as session:
                done = await _post(session, to, "/api/pin", json={"pin": pin, "name": own_name})
            if isinstance(done, Pushed):
                return done
            known = Pass(done[1], authority)
            passes.keep(to.key, known)
        if known.authority and to.scheme != "https":
            return Pushed(NEEDS_PIN, _ANOTHER)
        async with _session(known.authority) as session:
            with packed.open("rb") as body:
                cookie = {"Cookie": f"{COOKIE}={known.token}"}
                done = await _post(session, to, "/api/show", headers=cookie, data=body)
        if isinstance(done, Pushed):
            return done
        problems = " ".join(one["message"] for one in done[0].get("problems", ()))
        return Pushed(REFUSED, problems) if problems else Pushed(TAKEN, str(done[0].get("message", "")))
    except aiohttp.ClientConnectorCertificateError:
        return Pushed(NEEDS_PIN, _ANOTHER)
    except (aiohttp.ClientError, ValueError, TypeError, KeyError, OSError) as error:  # TimeoutError is one
        return Pushed(UNREACHABLE, str(error) or type(error).__name__)


async def _post(
    session: aiohttp.ClientSession,
    to: Neighbour,
    path: str,
    headers: dict[str, str] | None = None,
    **body: Any,
) -> tuple[dict[str, Any], str] | Pushed:
    """The object that is answered, and the cookie that is set; else what went wrong."""
    sent = {"Origin": to.origin, **(headers or {})}
    async with session.post(f"{to.origin}{path}", headers=sent, **body) as answer:
        text = (await body_of(answer, _LARGEST_ANSWER)).decode(errors="replace")
        if answer.status == 200:
            token = answer.cookies[COOKIE].value if COOKIE in answer.cookies else ""
            return dict(json.loads(text)), token
        is_pin = answer.status == 401 or (path == "/api/pin" and answer.status in _WRONG_PIN)
        return Pushed(NEEDS_PIN if is_pin else REFUSED, text)


def _session(authority: str) -> aiohttp.ClientSession:
    patience = aiohttp.ClientTimeout(total=_TAKEN_WITHIN_S, sock_connect=_REACHED_WITHIN_S)
    context = ssl.create_default_context(cadata=authority or None)
    return aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=context), timeout=patience)


async def _authority(to: Neighbour) -> str:
    """The certificate of that box's own authority, as it answers now; "" without HTTPS."""
    patience = aiohttp.ClientTimeout(total=_REACHED_WITHIN_S)
    async with (
        aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=unchecked()), timeout=patience) as session,
        session.get(f"{to.origin}/bunraku.crt") as answer,
    ):
        certificate = await body_of(answer, _LARGEST_ANSWER)
    return ssl.DER_cert_to_PEM_cert(certificate) if to.scheme == "https" else ""


async def body_of(answer: aiohttp.ClientResponse, most: int) -> bytes:
    """All of it, in however many parts it comes; of more than `most` bytes the first."""
    body = b""
    async for part in answer.content.iter_any():
        body += part
        if len(body) >= most:
            break
    return body[:most]


def unchecked() -> ssl.SSLContext:
    """For a first look at a box, which is its own authority."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context
