"""The samples drawn so far, and a file that survives whatever happens to the program.

The whole file is written anew and put in the place of the old one in one step (`eclipsejax.whole_file`). (emcee's own
HDF5 backend changes its file in place: killed half-way, HDF5 may not open it again.) A file holds all that the next
step depends on, so that a chain that was interrupted goes on bit for bit as if it had not been.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eclipsejax.errors import InputError
from eclipsejax.whole_file import reason, whole_file

FORMAT = 2


@dataclass(frozen=True)
class Chain:
    """Every step of every ensemble, burn-in included.

    - `z`: (ensemble, step, walker, parameter).
    - `log_posterior`: (ensemble, step, walker).
    - `accepted`: moves accepted so far (ensemble,).
    - `random`: state of each ensemble's random numbers after the last step, as `RandomState.get_state` gives it.
    """

    z: np.ndarray
    log_posterior: np.ndarray
    accepted: np.ndarray
    random: tuple

    @property
    def steps(self) -> int:
        """Steps done by each ensemble."""
        return self.z.shape[1]

    @property
    def acceptance(self) -> float:
        """Fraction of accepted moves."""
        return float(self.accepted.sum() / max(1, self.log_posterior.size))


@dataclass(frozen=True)
class Record:
    """What a chain file holds.

    - `identity`: what the chain depends on: photographs, priors, settings, versions; whatever JSON can hold.
    - `beginning`: numbers by name that the sampling began from.
    """

    identity: Mapping[str, Any]
    beginning: Mapping[str, Any]
    chain: Chain

    def write(self, path: Path) -> None:
        """Put this record in the place of what the file held, in one step."""
        try:
            with whole_file(path) as part, h5py.File(part, "w") as file:
                file.attrs.update(format=FORMAT, identity=json.dumps(self.identity), hash=digest(self.identity))
                for name, value in self.beginning.items():
                    file[f"beginning/{name}"] = value
                _write_chain(file, self.chain)
        except OSError as error:
            raise InputError(
                f"The chain cannot be written to {path} ({reason(error)}): make room or give --out another folder."
            ) from None


def read_record(path: Path, identity: Mapping[str, Any]) -> Record:
    """The record in a file, if it is of the same `identity`; `InputError` otherwise, with what differs."""
    try:
        with h5py.File(path) as file:
            wanted, format_ = file.attrs["hash"], file.attrs["format"]
            theirs = json.loads(str(file.attrs["identity"]))
            beginning = {name: dataset[()] for name, dataset in _group(file, "beginning").items()}
            chain = _read_chain(file)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path} cannot be read as a chain ({error}): leave out --resume to begin anew.") from None
    if format_ != FORMAT:
        raise InputError(f"{path} was written by another version of this program: leave out --resume.")
    if wanted != digest(identity):
        raise InputError(
            f"{path} holds the chain of another fit, which differs in {_differences(theirs, identity)}: leave out "
            "--resume, or give the photographs and options of that fit."
        )
    return Record(theirs, beginning, chain)


def _write_chain(file: h5py.File, chain: Chain) -> None:
    file["z"], file["log_posterior"], file["accepted"] = chain.z, chain.log_posterior, chain.accepted
    for number, (kind, keys, position, has_gauss, gauss) in enumerate(chain.random):
        file[f"random/{number}"] = keys
        file[f"random/{number}"].attrs.update(kind=kind, position=position, has_gauss=has_gauss, gauss=gauss)


def _read_chain(file: h5py.File) -> Chain:
    random = []
    for _, keys in sorted(_group(file, "random").items(), key=lambda item: int(item[0])):
        state = keys.attrs
        random.append(
            (str(state["kind"]), keys[()], int(state["position"]), int(state["has_gauss"]), float(state["gauss"]))
        )
    z, log_posterior, accepted = (np.asarray(file[name]) for name in ("z", "log_posterior", "accepted"))
    return Chain(z, log_posterior, accepted, tuple(random))


def _group(file: h5py.File, name: str) -> h5py.Group:
    group = file[name]
    if not isinstance(group, h5py.Group):
        raise KeyError(f"{name} is no group")
    return group


def digest(value: Any) -> str:
    """sha256 of what JSON can hold."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _differences(theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> str:
    ours = json.loads(json.dumps(ours))
    differing = [name for name in {**theirs, **ours} if theirs.get(name) != ours.get(name)]
    return " and ".join(differing) or "what is stored"
