"""The catalogue of photographs, and where a photograph is looked for."""

import hashlib
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest

from eclipsejax.errors import InputError
from inverse import catalogue as module
from inverse.catalogue import catalogue, photograph
from inverse.photo import read_photo

LICENSED, UNLICENSED = "2022-11-08-phone-binoculars/camera-19-33.jpg", "2015-09-28-canon-t2i/IMG_8742.jpg"


def test_every_row_is_complete_and_consistent():
    entries = catalogue()
    assert len({(entry.file, entry.disc) for entry in entries}) == len(entries) == 45
    for entry in entries:
        assert len(entry.sha256) == 64 and len(entry.commit) == 40 and int(entry.commit, 16)
        assert entry.address.startswith("https://") and " " not in entry.address
        assert entry.utc.endswith("Z") and entry.utc[:4] == entry.event[:4] == entry.file[:4]
        assert datetime.fromisoformat(entry.utc).utcoffset() is not None
        assert entry.local_time is None or datetime.fromisoformat(entry.local_time).tzinfo is None
        assert entry.site is None or (abs(entry.site[0]) <= 90 and abs(entry.site[1]) <= 180)
        assert entry.licence and entry.credit
    assert {entry.licence for entry in entries if entry.licensed} == {"CC-BY-4.0", "MIT"}


def test_rows_say_what_is_known_of_a_picture():
    entry = next(entry for entry in catalogue() if entry.file == UNLICENSED)
    assert (entry.exposure_s, entry.iso, entry.f_number, entry.disc, entry.site) == (
        1.0,
        6400.0,
        None,
        None,
        None,
    )
    assert entry.local_time == "2015-09-28T04:54:12" and not entry.licensed
    discs = [entry for entry in catalogue() if entry.file == "2022-05-16-newtonian/final.png"]
    assert [disc.disc for disc in discs] == [1, 2, 3, 4]
    assert (discs[3].utc, discs[3].site) == ("2022-05-16T04:06:00Z", (-10.944, -37.056))


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """A machine without photographs, and a catalogue whose licensed picture is the six bytes b"a moon"."""
    digest = hashlib.sha256(b"a moon").hexdigest()
    rows = tuple(replace(entry, sha256=digest) for entry in catalogue() if entry.file in (LICENSED, UNLICENSED))
    monkeypatch.setattr(module, "catalogue", lambda: rows)
    monkeypatch.setattr(module, "_CHECKOUT", tmp_path / "work" / "checkout")
    monkeypatch.delenv("ECLIPSEJAX_PHOTOS", raising=False)
    return tmp_path


def put(folder: Path, name: str, content: bytes = b"a moon") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


@pytest.fixture
def fetched(monkeypatch, tmp_path):
    """Calls of pooch.retrieve, which hands out b"a moon" without a network."""
    import pooch

    calls = []

    def retrieve(url, known_hash, fname, path, downloader):
        calls.append((url, known_hash))
        return str(put(tmp_path / "cache", fname))

    monkeypatch.setattr(pooch, "retrieve", retrieve)
    return calls


def test_the_named_folder_comes_first_then_the_shared_one_then_the_network(alone, monkeypatch, fetched):
    first, second = alone / "mine", alone / "work" / "shared" / "photos"
    put(first, LICENSED)
    put(second, LICENSED)
    monkeypatch.setenv("ECLIPSEJAX_PHOTOS", str(first))
    assert photograph(LICENSED) == first / LICENSED
    (first / LICENSED).unlink()
    assert photograph(LICENSED) == second / LICENSED
    assert not fetched
    (second / LICENSED).unlink()
    assert photograph("camera-19-33.jpg").read_bytes() == b"a moon"
    (url, known_hash), = fetched  # fmt: skip
    entry = module.catalogue()[1]
    assert url == f"https://raw.githubusercontent.com/{entry.repository}/{entry.commit}/{entry.path}"
    assert known_hash == "sha256:" + hashlib.sha256(b"a moon").hexdigest()


def refusal(*arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        photograph(*arguments, **options)
    text = str(caught.value)
    assert "\n" not in text and text.endswith(".")
    return text


def test_a_file_with_other_bytes_is_refused(alone):
    put(alone / "work" / "shared" / "photos", LICENSED, b"a sun")
    assert "sha256" in refusal(LICENSED)


def test_a_picture_without_a_licence_is_fetched_only_on_request(alone, fetched):
    text = refusal(UNLICENSED)
    assert "licence" in text and "allow_unlicensed" in text and not fetched
    assert photograph(UNLICENSED, allow_unlicensed=True).read_bytes() == b"a moon" and len(fetched) == 1
    put(alone / "work" / "shared" / "photos", UNLICENSED)  # but one that lies there is used
    assert photograph(UNLICENSED).is_file() and len(fetched) == 1


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError("no route to host\nat all"), "OSError"),
        (ValueError("SHA256 hash of downloaded file does not match the known hash"), "another one"),
    ],
)
def test_a_failed_download_is_one_sentence(alone, monkeypatch, error, said):
    import pooch

    def retrieve(*_, **__):
        raise error

    monkeypatch.setattr(pooch, "retrieve", retrieve)
    text = refusal(LICENSED)
    assert said in text and "cannot be fetched" in text and "ECLIPSEJAX_PHOTOS" in text


def test_pooch_itself_refuses_other_bytes(alone, monkeypatch, tmp_path):
    """The real pooch, with a downloader that writes a file of our own instead of asking the network."""
    import pooch

    monkeypatch.setattr(pooch, "os_cache", lambda _: tmp_path / "cache")
    served = [b"a sun"]
    monkeypatch.setattr(pooch, "HTTPDownloader", lambda **_: lambda url, target, _: Path(target).write_bytes(served[0]))
    assert "another one" in refusal(LICENSED)
    served[0] = b"a moon"
    assert photograph(LICENSED).read_bytes() == b"a moon"


def test_unknown_and_ambiguous_names_are_refused(alone, monkeypatch):
    assert "camera-19-33.jpg" in refusal("camera-19-34.jpg")
    entry = module.catalogue()[1]
    monkeypatch.setattr(module, "catalogue", lambda: (entry, replace(entry, file="other/camera-19-33.jpg")))
    assert "several" in refusal("camera-19-33.jpg")


def test_a_wrong_folder_in_the_environment_is_refused(alone, monkeypatch):
    monkeypatch.setenv("ECLIPSEJAX_PHOTOS", str(alone / "nowhere"))
    assert "nowhere" in refusal(LICENSED)


def test_missing_data_is_refused():
    with pytest.raises(InputError, match="nothing.csv"):
        module.data_file("nothing.csv")


def test_the_shared_photographs_are_those_of_the_catalogue(shared, monkeypatch):
    monkeypatch.setenv("ECLIPSEJAX_PHOTOS", str(shared / "photos"))
    for file in {entry.file for entry in catalogue()}:
        assert photograph(file) == shared / "photos" / file  # the hash is checked on the way


def test_the_catalogue_and_the_exif_agree(shared):
    for file in (UNLICENSED, "2020-11-30-penumbral/DSC03929_Penumbral_Eclipse_600.jpg"):
        entry = next(entry for entry in catalogue() if entry.file == file)
        photo = read_photo(shared / "photos" / file)
        assert (photo.local_time, photo.camera, photo.sha256) == (
            entry.local_time,
            entry.camera,
            entry.sha256,
        )
        assert (photo.exposure_s, photo.iso, photo.f_number) == (entry.exposure_s, entry.iso, entry.f_number)
        assert photo.pixels.shape == (entry.height, entry.width, 3)
