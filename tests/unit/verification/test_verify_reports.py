"""`verify` reports the verdict, a plot of light levels and, in JUnit files, settings as flags."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import pytest

from baker.cli.flags import in_flags
from baker.core.errors import SettingsError
from baker.metrics.limits import evaluate_limits, parse_limits
from baker.verification.junit import write_junit
from baker.verification.report_plots import level_plot
from baker.verification.verdict import verdict_sentence

METRICS = {"irradiance": {"bias": -0.0123, "median_excess": 0.02, "p95": 0.2}}
TOO_NOISY = "the reference stayed too noisy; raise `time_limit`"


def limits_of(text: str, **options):
    return evaluate_limits(parse_limits(text, ["irradiance"], ["bias", "p95", "max"]), METRICS, **options)


def test_a_good_bake_has_a_sentence_with_its_error_and_its_limits():
    found = verdict_sentence(limits_of("irradiance.bias > 0.02, irradiance.p95 > 0.5"), METRICS, default=True)
    assert found == (
        "The bake is good: irradiance is 1.23% too low on average and off by 2% at a typical texel;"
        " all 2 default limits hold."
    )


def test_a_bad_bake_has_a_sentence_with_what_failed():
    found = verdict_sentence(
        limits_of("irradiance.bias > 0.01, irradiance.p95 > 0.5"), METRICS, default=False
    )
    assert found == "The bake is not good: 1 of 2 limits of `fail_if` failed (irradiance.bias is -1.23%)."
    assert "limits of --fail-if failed" in in_flags(found)


def test_limits_without_a_value_are_counted():
    verdicts = limits_of("irradiance.bias > 0.02, irradiance.max > 1", missing_fails=False)
    assert "all 2 default limits hold, 1 of them without a value to test" in verdict_sentence(
        verdicts, METRICS, default=True
    )


@pytest.mark.parametrize("text", ["", "  "])
def test_empty_limits_are_refused(text):
    with pytest.raises(SettingsError, match="it is empty"):
        parse_limits(text, ["irradiance"], ["bias"])


def level(light, bias, **more):
    return {"level": f"light {light}", "light": light, "typical": 0.03, "typical_noise": 0.01, "bias": bias,
            "bias_se": 0.005, **more}  # fmt: skip


def test_the_plot_places_levels_by_their_light_and_error():
    rows = [level(100.0, -0.02), level(1.0, 0.02), level(10.0, 0.0), level(0.5, 0.9, level="the darkest 5%")]
    text = level_plot(rows)
    svg = ElementTree.fromstring(text[text.index("<svg") : text.index("</svg>") + len("</svg>")])
    dots = [(float(dot.attrib["cx"]), float(dot.attrib["cy"])) for dot in svg.iter("circle")]
    assert len(dots) == 3
    assert dots == sorted(dots)
    across, down = zip(*dots, strict=True)
    assert across[1] - across[0] == pytest.approx(across[2] - across[1], abs=0.2)
    assert down[1] - down[0] == pytest.approx(down[2] - down[1], abs=0.2)
    labels = [entry.text for entry in svg.iter("text")]
    assert {"1", "10", "100", "0%"} <= set(labels)


def test_a_plot_needs_two_levels():
    assert level_plot([level(1.0, 0.0)]) == ""
    assert level_plot([level(0.0, 0.0), level(1.0, 0.0)]) == ""


def test_junit_of_verify_names_flags(tmp_path):
    verdicts = limits_of("irradiance.bias > 0.01")
    check = SimpleNamespace(remarks={"bias": TOO_NOISY})
    bake = SimpleNamespace(folder=SimpleNamespace(name="out"))
    found = SimpleNamespace(bake=bake, verdicts=verdicts, channels={"irradiance": check}, seconds=1.0)
    write_junit(tmp_path / "r.xml", found, in_flags)
    message = next(ElementTree.parse(tmp_path / "r.xml").iter("failure")).attrib["message"]
    assert "raise --time-limit" in message
    assert "bias is -1.23%" in message
