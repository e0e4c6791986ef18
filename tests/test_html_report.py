"""The report to read: whole HTML, all in one file, its numbers there, and strangers' words only ever as text."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from inverse import prior
from inverse.html_report import doubts, html_report, plain_sentence, write_html
from inverse.information import information
from inverse.likelihood import LIMB
from inverse.map_estimate import Optimum
from inverse.report import text_report, write_pictures
from inverse.result import Fit
from tests.test_report import fake_fit, photograph

HOSTILE = "\"><script>alert(1)</script><img src=x onerror=alert(2)>&amp; '<b>Mond 日食.jpg"
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Document(HTMLParser):
    """Checks that what is opened is closed, in order, and gathers tags, attributes and text."""

    def __init__(self, text: str):
        super().__init__()
        self.open, self.tags, self.attributes, self.text = [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def further(utc: str, stops: float, left: float, bits: float) -> dict:
    return {"utc": utc, "stops": stops, "remains": {"dust.extinction": left}, "bits": bits}


def diagnosed(fit: Fit) -> Fit:
    """With the diagnostics of a real fit of one photograph."""
    labels = [*(parameter.name for parameter in prior.ATMOSPHERE), "1.gain"]
    covariance = np.diag([0.04] + [0.5] * LIMB)
    check = {"chi_squared": 2890.1, "effective_data": 2871.3, "per_datum": 1.0065, "p": 0.4}
    diagnostics = {
        **fit.diagnostics,
        "errors": [{"independent": 0.83, "smooth": 0.123, "chromatic": 0.037, "uneven": 0.1}],
        "misfit_checks": [
            {
                "all": check,
                "smooth": {**check, "effective_data": 91.0},
                "broad": {**check, "effective_data": 9.0},
                "p": 0.8,
            }
        ],
        "information": information(Optimum(np.zeros(10), 0.0, True, 9, np.linalg.inv(covariance), ()), labels),
        "independent_errors": {"dust.extinction": {"sd": 4.1e-7, "sd_independent": 5.2e-8, "ratio": 7.88}},
        "further_photographs": {
            "camera_of": HOSTILE,
            "best_for_dust": [further("2015-09-28T03:01:00Z", -6.0, 0.37, 2.4)],
            "most_bits": further("2015-09-28T03:20:00Z", 0.0, 0.41, 2.9),
        },
        "sampler": {"steps": 4321, "r_hat": None, "converged": True, "unmet": []},
        "psis": None,
    }
    return replace(fit, diagnostics=diagnostics)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A fit of a photograph whose name, camera and warnings are somebody's attack, and its pictures."""
    folder = tmp_path_factory.mktemp("html")
    fit = diagnosed(fake_fit())
    fit = replace(
        fit,
        photos=(replace(photograph(), name=HOSTILE),),
        warnings=(f"{HOSTILE}: no site is known.",),
        provenance={**fit.provenance, "photographs": [{"name": HOSTILE, "camera": HOSTILE, "sha256": "c0ffee"}]},
        estimates={**fit.estimates, "1.<i>gain": replace(fit.estimates["1.gain"], name="1.<i>gain")},
    )
    path = write_html(fit, folder, write_pictures(fit, folder))
    return fit, path.read_text(encoding="utf-8"), path


def test_one_file_holds_all_and_asks_for_nothing(hostile):
    _, text, path = hostile
    found = Document(text)
    assert path.name == "report.html" and found.tags.count("img") == 3
    assert not {"script", "link", "iframe", "object", "embed", "b", "i", "a"} & set(found.tags)
    assert "http://" not in text and "https://" not in text and "<script" not in text.lower()
    sources = [value for _, name, value in found.attributes if name in ("src", "href")]
    assert len(sources) == 3 and all(value.startswith("data:image/png;base64,iVBOR") for value in sources)
    assert not any(name.startswith("on") for _, name, _ in found.attributes)


def test_strangers_words_are_text(hostile):
    fit, text, _ = hostile
    found = Document(text)
    # In the heading, the warnings, the table of errors, the advice, twice in the provenance; the title is text as well.
    assert found.text.count(HOSTILE) == 7
    assert HOSTILE not in text and "&lt;script&gt;" in text
    assert "1.<i>gain" in found.text and fit.warnings[0] in found.text


def test_the_numbers_are_there(hostile):
    fit, text, _ = hostile
    said = Document(text).text
    dust, depth = fit.estimates["dust.extinction"], fit.estimates["stratospheric_optical_depth"]
    for estimate in (dust, depth, fit.estimates["clouds.top"]):
        for value in (f"{estimate.map:.4g}", f"{estimate.sd:.3g}", f"{estimate.median:.4g}", estimate.unit):
            assert value in said
        for low, high in (estimate.ci68, estimate.ci95, estimate.prior_ci95):
            assert f"{low:.3g} … {high:.3g}" in said
        assert f"{100 * estimate.informed:.0f} %" in said
    assert f"optical depth of {depth.median:.2g}" in said and "Pinatubo" in said and "0.1 to 0.15" in said
    told = "12.3 %", "3.7 %", "0.83", "1.01 of 2871", "1.01 of 91", "5.2e-08 /m", "7.88 times as much", "4321", "c0ffee"
    for words in (*told, "03:01:00Z, exposed 6 stops less", "fall to 37%", "2.9 bits", "03:20:00Z, exposed alike"):
        assert words in said
    assert "bits" in said and "Averaging kernel" in said and "prior-dominated" not in said.split("Averaging")[1]
    assert "sampler: r_hat" in said and "seed" in said and "nuisances" in said


def test_a_fit_without_diagnostics_or_pictures_is_still_a_page():
    text = html_report(replace(fake_fit(sampled=False), warnings=()))
    found = Document(text)
    assert "img" not in found.tags and "Warnings" not in found.text and "Laplace's approximation only" in found.text


def test_the_plain_sentence_knows_limits_and_what_is_only_believed():
    fit = fake_fit()
    depth = fit.estimates["stratospheric_optical_depth"]

    def told(**changed):
        one = replace(depth, **changed)
        return plain_sentence(replace(fit, estimates={**fit.estimates, one.name: one}))

    measured = {"prior_ci95": (4e-4, 0.13), "informed": 0.9}
    assert told(**measured, median=0.02, ci95=(0.01, 0.04)).endswith("less than then.")
    assert told(**measured, median=0.2, ci95=(0.16, 0.25)).endswith("more than then.")
    assert told(**measured, median=0.1, ci95=(0.05, 0.2)).endswith("possibly as much.")
    assert "took 2 % of the light" in told(**measured, median=0.02, ci95=(0.01, 0.04))
    assert told(**measured, median=0.004, ci95=(4e-4, 0.03)).startswith("At most 3 % of the light")
    assert "hardly tell" in told(prior_ci95=(4e-4, 0.13), informed=0.1, median=0.02, ci95=(0.01, 0.2))


def test_doubts_stand_under_the_result():
    fit = diagnosed(fake_fit())
    assert doubts(fit) == []
    lost = {
        **fit.diagnostics,
        "converged": False,
        "errors": [{"independent": 1.0, "smooth": 0.4, "chromatic": 0.05, "uneven": 0.1}],
    }
    said = html_report(replace(fit, diagnostics=lost))
    assert said.count("Do not rely on this number.") == 2 and "wrong by 40 %" in said


def test_the_command_prints_how_much_was_learnt():
    text = text_report(diagnosed(fake_fit()))
    assert "quantities of the limb" in text and "it is 4.1e-07 /m" in " ".join(text.split())
    assert max(map(len, text.split("\n\n")[2].splitlines())) <= 110


def test_a_name_that_is_no_unicode_is_written_all_the_same(tmp_path):
    fit = replace(fake_fit(), photos=(replace(photograph(), name="Mond\udce4.jpg"),))
    assert "Mond?.jpg" in write_html(fit, tmp_path, []).read_text(encoding="utf-8")
