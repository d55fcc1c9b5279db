"""Proves to a device that one knows its password, without sending it: SCRAM-SHA-256 (RFC 5802, RFC 7677) in packets of
our own (docs/protocol.md)."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import unicodedata
from collections.abc import Callable
from functools import lru_cache

from plctool.core import lib
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.link.wire import Layout

AskPassword = Callable[[], str | None]
"""Gives the password when a device asks for it; None: there is none."""

MIN_LENGTH = 8
MAX_LENGTH = 256
_ITERATIONS = 100_000  # of new passwords: about 50 ms on a PC, and as long for each guess of who has heard a login

_CHALLENGE = Layout("DEV_CHALLENGE")
_PROOF = Layout("DEV_PROOF")
_VERIFIER = Layout("USER_VERIFIER")


def no_password() -> str | None:
    """The AskPassword of who has none."""
    return None


def password_needed() -> DeviceError:
    return DeviceError(
        "The device has a password: give it with --password-file or in the environment's PLC_PASSWORD, or run plctool "
        "in a terminal, where it asks.",
        "password-needed",
        lib.ERR_NO_ACCESS_RIGHTS,
    )


def wrong_password() -> DeviceError:
    return DeviceError(
        "The device refused the password; try again with the right one. docs/security.md says how to remove a "
        "forgotten one.",
        "wrong-password",
        lib.ERR_NO_ACCESS_RIGHTS,
    )


def password_not_taken() -> DeviceError:
    return DeviceError(
        "The device takes no password now, because it was given wrong ones before; try again in a moment.",
        "password-not-taken",
        lib.ERR_NOT_READY_YET,
    )


def verifier_of(password: str | None) -> bytes:
    """What a device keeps of a password (USER_VERIFIER); all zero for none. Raises UsageError for one that is too short
    or too long."""
    if password is None:
        return _VERIFIER.pack()
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        raise UsageError(f"A password has {MIN_LENGTH} to {MAX_LENGTH} characters; choose another one.", "bad-password")
    salt = secrets.token_bytes(16)
    key = hashlib.sha256(_client_key(password, salt, _ITERATIONS)).digest()
    return _VERIFIER.pack(key=key, salt=salt, iterations=_ITERATIONS)


def proof_of(password: str, challenge: bytes) -> bytes:
    """The DEV_PROOF that answers a DEV_CHALLENGE. Raises LinkError for one with fewer iterations than this tool sets: a
    false device would find the password from the proof sooner."""
    asked = _CHALLENGE.unpack(challenge)
    if not _ITERATIONS <= asked.iterations <= lib.PASSWORD_MAX_ITERATIONS:
        raise LinkError(
            f"The device asks for {asked.iterations} iterations of the password, and plctool answers {_ITERATIONS} to "
            f"{lib.PASSWORD_MAX_ITERATIONS}: with fewer the password is easier to guess from the answer. It may not be "
            "the device that you think it is. If it is, another tool has set its password: remove that at the device "
            "(docs/security.md, 'Forgotten') and set it again with 'plctool passwd'.",
            "protocol",
        )
    nonce = secrets.token_bytes(16)
    key = _client_key(password, asked.salt, asked.iterations)
    signature = hmac.digest(hashlib.sha256(key).digest(), challenge[: _CHALLENGE.size] + nonce, "sha256")
    return _PROOF.pack(nonce=nonce, proof=bytes(a ^ b for a, b in zip(key, signature, strict=True)))


def is_same(a: str, b: str) -> bool:
    """Whether two passwords are equal; takes as long whatever they are."""
    return hmac.compare_digest(_bytes(a), _bytes(b))


@lru_cache(maxsize=1)  # a login may be tried several times
def _client_key(password: str, salt: bytes, iterations: int) -> bytes:
    salted = hashlib.pbkdf2_hmac("sha256", _bytes(password), salt, iterations)
    return hmac.digest(salted, b"Client Key", "sha256")


def _bytes(password: str) -> bytes:
    """However a keyboard composes its characters. Raises UsageError for what is no text."""
    try:
        return unicodedata.normalize("NFKC", password).encode()
    except UnicodeEncodeError:
        raise UsageError("The password is not UTF-8; set it in a terminal with UTF-8.", "bad-password") from None
