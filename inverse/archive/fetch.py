"""Fetching a photograph of a catalogue: by https from the open internet, so many bytes at most, checked, or nothing."""

import hashlib
import ipaddress
import os
import socket
import time
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit
from urllib.request import BaseHandler, HTTPRedirectHandler, Request, build_opener

from eclipsejax.errors import InputError, printable
from eclipsejax.whole_file import whole_file
from inverse.archive.catalogue import Listed, check_address
from inverse.archive.rows import unwritable
from inverse.filetype import SUFFIXES

MOST_BYTES = 300e6
MOST_SECONDS = 900.0  # altogether; one answer may take SILENCE
SILENCE = 30.0  # s
CHUNK = 1 << 18


def file_of(one: Listed, out: Path) -> tuple[Listed, Path | None, str | None, str | None]:
    """Where a photograph lies, fetched if need be, and its sha256; or why it cannot be used."""
    if one.refused:
        return one, None, None, one.refused
    try:
        if one.path is None:
            return one, *fetched(one.source, out / "photographs", one.sha256), None
        sha256 = file_hash(one.path)
        if one.sha256 not in (None, sha256):
            raise InputError(f"{one.source} is another file than the catalogue says: its sha256 is {sha256}.")
        return one, one.path.absolute(), sha256, None
    except InputError as error:
        return one, None, None, str(error)
    except OSError as error:
        raise unwritable(out, error) from None


def file_hash(path: Path) -> str:
    """sha256 of a file; `InputError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}): check its permissions.") from None


def place_of(address: str, folder: Path) -> Path:
    """Where the file of an address is kept: a name made of nothing that the address says, but for a known suffix."""
    suffix = PurePosixPath(urlsplit(address).path).suffix.lower()
    name = hashlib.sha256(address.encode()).hexdigest()[:32]
    return folder / (name + (suffix if suffix in SUFFIXES else ""))


def fetched(address: str, folder: Path, sha256: str | None = None) -> tuple[Path, str]:
    """The file of an address and its sha256; fetched, unless it was before. `InputError` where it cannot be had.

    What the disk cannot hold raises `OSError`.
    """
    path = place_of(address, folder)
    if path.is_file():
        found = file_hash(path)
        if sha256 in (None, found):
            return path, found
    with whole_file(path, f".{os.getpid()}") as part:
        found = _streamed(address, part)
        if sha256 not in (None, found):
            raise InputError(f"{address} is another file than the catalogue says: its sha256 is {found}.")
    return path, found


def _streamed(address: str, part: Path) -> str:
    """Writes what an address sends, and returns its sha256."""
    check_address(address)
    digest, size, end = hashlib.sha256(), 0, time.monotonic() + MOST_SECONDS
    with part.open("wb") as file:
        try:
            with _opener().open(Request(address, headers={"User-Agent": "eclipsejax"}), timeout=SILENCE) as answer:
                while chunk := answer.read1(CHUNK):
                    size += len(chunk)
                    if size > MOST_BYTES:
                        raise InputError(f"{address} sends more than {MOST_BYTES / 1e6:.0f} MB: it is no photograph.")
                    if time.monotonic() > end:
                        raise InputError(f"{address} sends too slowly: fetch it yourself and name the file.")
                    digest.update(chunk)
                    _write(file, chunk)
                if answer.length:  # what was promised and did not come
                    raise InputError(f"{address} was cut short: run the same command again.")
        except (OSError, HTTPException, ValueError) as error:
            if isinstance(error, InputError | _Disk):
                raise
            reason = " ".join(str(getattr(error, "reason", None) or error).split()) or type(error).__name__
            raise InputError(f"{address} cannot be fetched ({reason}): check the address and the network.") from None
    return digest.hexdigest()


class _Disk(OSError):
    """The disk's fault, not the network's: both are `OSError`."""


def _write(file, chunk: bytes) -> None:
    try:
        file.write(chunk)
    except OSError as error:
        raise _Disk(error.errno, error.strerror) from None


class _OnlyHttps(HTTPRedirectHandler):
    def redirect_request(self, req, fp, code, msg, headers, newurl):
        check_address(newurl)
        return super().redirect_request(req, fp, code, msg, headers, newurl)


class _OnlyPublic(BaseHandler):
    """Looks at every request before it is sent, those that redirects make among them."""

    def https_request(self, request: Request) -> Request:
        check_public(request.full_url)
        return request


def check_public(address: str) -> None:
    """`InputError` where the host of an https address is, or stands for, a place that is not on the open internet.

    A catalogue from elsewhere is not to reach this machine or its network. A name that stands for another place a
    moment later leads nowhere: what answers there has no certificate for it.
    """
    parts = urlsplit(address)
    try:
        known = socket.getaddrinfo(parts.hostname, parts.port or 443, type=socket.SOCK_STREAM)
    except socket.gaierror:  # a proxy may know the name; else the connection tells
        return
    for *_, (number, *_) in known:
        place = ipaddress.ip_address(str(number).partition("%")[0])
        place = getattr(place, "ipv4_mapped", None) or place
        if not place.is_global or place.is_multicast:
            raise InputError(
                f"{printable(address)} leads to {place}, which is not on the open internet: fetch it yourself and name "
                "the file."
            )


def _opener():
    return build_opener(_OnlyHttps, _OnlyPublic)
