"""Transfer curves and primaries of ICC profiles, and the noise of JPEG, against Pillow's own codecs."""

import io
import struct

import numpy as np
import pytest
from PIL import Image, ImageCms

from inverse import tone

# Primaries of Display P3 in the D50 space of ICC profiles, as phones write them.
P3_TO_D50 = [[0.51512, 0.29198, 0.15710], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]]


def icc(curve: bytes, primaries=P3_TO_D50, space=b"RGB ") -> bytes:
    """An ICC profile of curves and matrix, the least that littlecms accepts."""
    parts = {name: curve for name in ((b"rTRC", b"gTRC", b"bTRC") if space == b"RGB " else (b"kTRC",))}
    white = struct.pack(">4s4x3i", b"XYZ ", 63190, 65536, 54061)
    parts[b"wtpt"] = white
    for name, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), np.transpose(primaries), strict=True):
        parts[name] = struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * value) for value in column))
    table, body, start = struct.pack(">I", len(parts)), b"", 132 + 12 * len(parts)
    for name, data in parts.items():
        data += bytes(-len(data) % 4)
        table += struct.pack(">4sII", name, start + len(body), len(data))
        body += data
    header = struct.pack(">I4sI4s4s4s", 0, b"    ", 0x02100000, b"mntr", space, b"XYZ ") + bytes(12) + b"acsp"
    header += bytes(28) + struct.pack(">3i", 63190, 65536, 54061)
    header = header.ljust(128, b"\0")
    return struct.pack(">I", len(header) + len(table) + len(body)) + header[4:] + table + body


def parametric(kind: int, *numbers: float) -> bytes:
    return struct.pack(f">4s4xH2x{len(numbers)}i", b"para", kind, *(round(65536 * number) for number in numbers))


SRGB = parametric(3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
RAMP = np.linspace(0, 1, 101)


def test_srgb_profiles_change_nothing():
    curve, primaries = tone.profile(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    assert curve is not None
    assert curve(RAMP) == pytest.approx(tone.srgb_to_linear(RAMP), abs=2e-4)
    assert (primaries == np.eye(3)).all()


def test_display_p3_turns_the_red_of_srgb_as_littlecms_does():
    data = icc(SRGB)
    curve, primaries = tone.profile(data)
    assert curve is not None and curve(RAMP) == pytest.approx(tone.srgb_to_linear(RAMP), abs=1e-4)
    # littlecms turns colours of sRGB into codes of the profile; both are linearised and compared.
    colours = np.random.default_rng(0).integers(60, 200, (8, 8, 3), dtype=np.uint8)
    transform = ImageCms.buildTransform(
        ImageCms.createProfile("sRGB"),
        ImageCms.ImageCmsProfile(io.BytesIO(data)),
        "RGB",
        "RGB",
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
    )
    turned = ImageCms.applyTransform(Image.fromarray(colours), transform)
    expected = tone.srgb_to_linear(np.asarray(turned) / 255)
    assert tone.srgb_to_linear(colours / 255) @ primaries.T == pytest.approx(expected, abs=4e-3)
    assert primaries.sum(axis=1) == pytest.approx(np.ones(3), abs=2e-3)  # white stays white


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (struct.pack(">4s4xIH", b"curv", 1, round(2.2 * 256)), RAMP ** (round(2.2 * 256) / 256)),
        (struct.pack(">4s4xI", b"curv", 0), RAMP),
        (
            struct.pack(">4s4xI1024H", b"curv", 1024, *np.linspace(0, 1, 1024).__pow__(2).__mul__(65535).astype(int)),
            RAMP**2,
        ),
        (parametric(0, 1.8), RAMP**1.8),
        (parametric(1, 2.0, 1.25, -0.25), np.maximum(1.25 * RAMP - 0.25, 0) ** 2),
        (parametric(2, 2.0, 1.25, -0.25, 0.1), np.maximum(1.25 * RAMP - 0.25, 0) ** 2 + 0.1),
        (SRGB, tone.srgb_to_linear(RAMP)),
        (
            parametric(4, 2.0, 0.9, 0.0, 0.5, 0.25, 0.15, 0.05),
            np.where(RAMP >= 0.25, (0.9 * RAMP) ** 2 + 0.15, 0.5 * RAMP + 0.05),
        ),
    ],
)
@pytest.mark.parametrize("space", [b"RGB ", b"GRAY"])
def test_curves_of_every_kind(curve, expected, space):
    found, primaries = tone.profile(icc(curve, space=space))
    assert found is not None and found(RAMP) == pytest.approx(expected, abs=2e-3)
    assert primaries.shape == (3, 3)


@pytest.mark.parametrize("gamma", [struct.pack(">4s4xIH", b"curv", 1, 256), parametric(0, 1.0)])
def test_a_gamma_of_one_is_known_as_linear(gamma):
    assert tone.profile(icc(gamma))[0] is tone.linear


def test_broken_profiles_are_ignored():
    data, random = icc(SRGB), np.random.default_rng(0)
    assert tone.profile(None)[0] is None and tone.profile(b"")[0] is None
    for length in range(0, len(data), 7):
        tone.profile(data[:length])
    for _ in range(300):
        damaged = bytearray(data)
        for place in random.integers(16, len(data), 6):
            damaged[place] = random.integers(256)
        curve, primaries = tone.profile(bytes(damaged))
        if curve is not None:
            assert np.isfinite(curve(RAMP)).all()
        assert np.isfinite(primaries).all()


def disc(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A textured, coloured disc on black sky, in codes: without and with noise, (512, 640, 3)."""
    y, x = np.mgrid[:512, :640]
    texture = sum(a * np.sin(x / s + y / (1.3 * s) + s) for s, a in ((40, 10), (17, 6), (7, 4), (3, 2)))
    inside = 1 / (1 + np.exp((np.hypot(y - 250, x - 300) - 180) / 3))
    clean = np.stack([150 + texture, 90 + 0.7 * texture, 50 + 0.4 * texture], axis=-1) * inside[..., None]
    noisy = clean + np.random.default_rng(1).normal(0, noise, clean.shape)
    return clean, np.clip(np.round(noisy), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("quality", [50, 75, 90, 97])
@pytest.mark.parametrize("subsampling", [0, 1, 2])
def test_the_noise_of_jpeg_is_right_within_a_factor(quality, subsampling):
    clean, codes = disc(0)
    buffer = io.BytesIO()
    Image.fromarray(codes).save(buffer, "JPEG", quality=quality, subsampling=subsampling)
    with Image.open(buffer) as image:
        decoded = np.asarray(image)
        stated = tone.jpeg_noise(decoded, image.quantization, image.layer)  # pyright: ignore
    on_disc = clean[..., 0] > 100
    true = np.mean((decoded - clean)[on_disc] ** 2, axis=0)
    assert (0.6 * true < stated + 1 / 12).all() and (stated + 1 / 12 < 1.8 * true).all()


def test_jpeg_noise_grows_as_quality_falls():
    _, codes = disc(2)
    stated = []
    for quality in (95, 80, 60, 30):
        buffer = io.BytesIO()
        Image.fromarray(codes).save(buffer, "JPEG", quality=quality)
        with Image.open(buffer) as image:
            stated.append(tone.jpeg_noise(np.asarray(image), image.quantization, image.layer))  # pyright: ignore
    assert (np.diff(stated, axis=0) > 0).all()
