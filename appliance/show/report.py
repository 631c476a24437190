"""box.yaml's section about reports to a technician who is far away: by a webhook, by mail."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, model_validator

from appliance.show.section import LocalFile, Section, key, refusal


def _web_address(text: str) -> str:
    scheme, _, rest = text.partition("://")
    if scheme not in ("http", "https") or not rest.partition("/")[0] or not text.isprintable() or " " in text:
        raise refusal(f"'{text}' is no web address.", "Write it like https://hooks.example.org/abc.")
    return text


def _mail_address(text: str) -> str:
    name, _, host = text.rpartition("@")
    if not name or not host or not text.isascii() or not text.isprintable() or any(c in text for c in " <>,"):
        raise refusal(f"'{text}' is no mail address.", "Write it like stage@example.org.")
    return text


MailAddress = Annotated[str, AfterValidator(_mail_address)]


class MailConfig(Section):
    """How reports go out by mail."""

    to: list[MailAddress] = key("Recipients.", length=(1, 8))
    sender: MailAddress = key("Sender's address.")
    host: str = key("The mail server.", length=(1, 200))
    port: int = key("Its port.", 587, within=(1, 65535))
    encryption: Literal["starttls", "tls", "none"] = key(
        "starttls: usual at port 587; tls: usual at port 465; none: only for a server at the venue.",
        "starttls",
    )
    user: str | None = key("User name at the server; null: it asks for none.", None, length=(1, 200))
    password: LocalFile | None = key(
        "File with the password, relative to the box file, readable for the box only.", None
    )

    @model_validator(mode="after")
    def _password_needs_encryption(self) -> MailConfig:
        if (self.user is None) != (self.password is None):
            raise refusal("A user and a password belong together.", "Give both or none.", at="user")
        if self.password is not None and self.encryption == "none":
            raise refusal(
                "The password would be sent unencrypted.", "Write `encryption: starttls`.", at="encryption"
            )
        return self


class ReportConfig(Section):
    """Reports when the box came on, and when a fallback began or ended."""

    webhook: Annotated[str, AfterValidator(_web_address)] | None = key(
        "Web address that gets each report as JSON by POST: `text`, `host`, `time`, `fallbacks`. Many chat "
        "programs show `text`.",
        None,
        length=(1, 500),
    )
    mail: MailConfig | None = key("Reports by mail; null: none.", None)
    after_s: float = key("A fallback is reported when it lasts this long, seconds.", 10.0, within=(0, 600))
    every_s: float = key(
        "Reports are at least this far apart, seconds; one report tells all changes meanwhile.",
        60.0,
        within=(5, 3600),
    )

    @model_validator(mode="after")
    def _goes_somewhere(self) -> ReportConfig:
        if self.webhook is None and self.mail is None:
            raise refusal("A report goes nowhere.", "Give a `webhook` or `mail`.", at="webhook")
        return self
