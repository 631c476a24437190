"""Updates from the page: a signed package from a stick or a browser, installed after a code from the wall.

The page's process only places files. `bunraku-update.service` installs them as root by `bunraku-release
install`, which checks signature, age and processor, tries the release out of sight, and goes back by itself.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import secrets
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from aiohttp import web

from appliance.console.body import PART, new_file, received, said
from appliance.console.update_code import CODE_FILE

FOLDER = "update"  # in the runtime folder: the package, its signature, and `install` once it is wanted
WANTED, RUNS = "install", "installing"  # bunraku-update.service renames one to the other
STICK = Path("/media/bunraku/bunraku/release")
KEYS = Path("/opt/bunraku/current/keys")
VALID_S = 600.0
TRIES = 3
_NAME = re.compile(r"bunraku_[0-9A-Za-z.+~:-]{1,60}_(?:amd64|arm64)\.deb(?:\.sig)?")
_SIGNATURE = ".sig"
_LARGEST = 300 << 20  # bytes; real packages have a third of that
_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none is taken for another one
_GROUPS, _GROUP = 3, 4


class _Code(NamedTuple):
    """until: monotonic seconds; tries: wrong ones so far."""

    text: str
    until: float
    tries: int = 0


class Update:
    """Requests about updates, one at a time. show_goes: whether people see the show now."""

    def __init__(
        self,
        runtime: Path,
        is_installed: bool,
        show_goes: Callable[[], bool],
        stick: Path = STICK,
        keys: Path = KEYS,
    ) -> None:
        self._is_installed, self._show_goes = is_installed, show_goes
        self._folder, self._card = runtime / FOLDER, runtime / CODE_FILE
        self._stick, self._keys = stick, keys
        self._code: _Code | None = None
        self._taking = asyncio.Lock()
        self._forget()

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/update", self._state),
            web.post("/api/update/file", self._take_file),
            web.post("/api/update/stick", self._take_stick),
            web.post("/api/update/begin", self._begin),
            web.post("/api/update/confirm", self._confirm),
        ]

    async def _state(self, request: web.Request) -> web.Response:
        """can: this box takes updates here; stick: packages on it; ready: the package that is whole here."""
        names = await asyncio.to_thread(_names, self._stick)
        return web.json_response(
            {
                "can": self._is_installed and self._keys.is_file(),
                "stick": [one for one in names if one + _SIGNATURE in names],
                "ready": self._ready(),
                "installing": self._installs,
            }
        )

    async def _take_file(self, request: web.Request) -> web.Response:
        """The body is a file; ?name= is its name. A package and its signature come one after the other."""
        self._require_possible()
        name = request.query.get("name", "")
        if _NAME.fullmatch(name) is None:
            raise web.HTTPBadRequest(
                text="This is no update. Give bunraku_VERSION_amd64.deb or _arm64.deb, and its .deb.sig."
            )
        async with self._alone():
            self._make_room(name)
            try:
                await received(request, self._folder / name, _LARGEST)
            except web.HTTPException:
                self._remove()
                raise
        return web.json_response({"ready": self._ready()})

    async def _take_stick(self, request: web.Request) -> web.Response:
        """{"name"} of a package on the stick."""
        self._require_possible()
        name = (await said(request)).get("name")
        names = await asyncio.to_thread(_names, self._stick)  # a stick that is dying answers late
        if not isinstance(name, str) or name not in names or name.endswith(_SIGNATURE):
            raise web.HTTPNotFound(text="There is no such update on the stick.")
        async with self._alone():
            self._make_room(name)
            try:
                for one in (name, name + _SIGNATURE):
                    await asyncio.to_thread(_copy, self._stick / one, self._folder / one)
            except OSError as error:
                self._remove()
                raise web.HTTPServiceUnavailable(
                    text=f"The stick cannot be read ({error.strerror}). Copy the update to it again."
                ) from None
        return web.json_response({"ready": self._ready()})

    async def _begin(self, request: web.Request) -> web.Response:
        """Make the code, which the wall shows: the PIN alone does not install from outside of the hall."""
        self._require_possible()
        await said(request)
        if self._ready() is None:
            raise web.HTTPConflict(text="The update is not here yet: a package and its signature.")
        if self._show_goes():
            raise web.HTTPConflict(text="The show is running. Stop it, then update.")
        text = "-".join(_letters() for _ in range(_GROUPS))
        self._code = _Code(text, time.monotonic() + VALID_S)
        descriptor = os.open(self._card, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(descriptor, "w") as card:
            card.write(text)
        return web.json_response({"seconds": VALID_S})

    async def _confirm(self, request: web.Request) -> web.Response:
        """{"code"} as the wall shows it."""
        self._require_possible()
        given = (await said(request)).get("code")
        if self._code is None or time.monotonic() > self._code.until:
            self._forget()
            raise web.HTTPGone(text="This code is over. Begin again.")
        plain = re.sub(r"[^a-z0-9]", "", given.lower()) if isinstance(given, str) else ""
        if not secrets.compare_digest(plain, self._code.text.replace("-", "")):
            self._code = self._code._replace(tries=self._code.tries + 1)
            if self._code.tries >= TRIES:
                self._forget()
            raise web.HTTPForbidden(text="This is not the code on the wall.")
        self._forget()
        if self._show_goes():
            raise web.HTTPConflict(text="The show is running. Stop it, then update.")
        (self._folder / WANTED).touch()
        return web.json_response({"done": True})

    def _require_possible(self) -> None:
        if not self._is_installed or not self._keys.is_file():
            raise web.HTTPConflict(
                text="This box takes no updates here: it is not installed, or knows no key of its maker."
            )
        if self._installs:
            raise web.HTTPConflict(text="An update is being installed. Wait for its end.")

    @contextlib.asynccontextmanager
    async def _alone(self) -> Any:
        if self._taking.locked():
            raise web.HTTPConflict(text="An update is on its way already. Wait for its end.")
        async with self._taking:
            yield

    def _make_room(self, name: str) -> None:
        """One package and its signature; another one takes their place."""
        self._forget()
        self._folder.mkdir(mode=0o700, exist_ok=True)
        package = name.removesuffix(_SIGNATURE)
        for path in self._folder.iterdir():
            if path.name not in (package, package + _SIGNATURE):
                path.unlink()

    @property
    def _installs(self) -> bool:
        return any((self._folder / name).exists() for name in (WANTED, RUNS))

    def _ready(self) -> str | None:
        names = _names(self._folder)
        return next((one for one in names if one + _SIGNATURE in names), None)

    def _remove(self) -> None:
        for name in _names(self._folder):
            (self._folder / name).unlink(missing_ok=True)

    def _forget(self) -> None:
        self._code = None
        with contextlib.suppress(OSError):
            self._card.unlink(missing_ok=True)


def _letters() -> str:
    return "".join(secrets.choice(_LETTERS) for _ in range(_GROUP))


def _names(folder: Path) -> list[str]:
    """Packages and signatures there, the newest name last."""
    with contextlib.suppress(OSError):
        return sorted(path.name for path in folder.iterdir() if _NAME.fullmatch(path.name))
    return []


def _copy(source: Path, path: Path) -> None:
    """A stick may hold anything: no link is followed, no pipe awaited."""
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
    with os.fdopen(os.open(source, flags), "rb") as read, new_file(path) as written:
        for _ in range(_LARGEST // PART):
            part = read.read(PART)
            if not part:
                return
            written.write(part)
    raise OSError(27, "it is larger than any update")
