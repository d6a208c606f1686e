"""Numbers and the one sentence, as they are read."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from scenarios.load import load_sensor
from scenarios.scenario import CameraSensor
from simbench.case import ORACLE
from simbench.plugins import pipeline_names
from simbench.report.choose import groups_of, mean_of_runs
from simbench.report.names import OURS
from simbench.report.words import (
    fault_words,
    joined,
    metres,
    percent,
    pipeline_words,
    points,
    runs_words,
    sentence,
    signed_m,
    stamp_words,
)
from tests.simbench.report.make import PIPELINES, faults, result, without_target


@pytest.mark.parametrize(
    ("share", "text"), [(0.7664, "76.6"), (0.0, "0.0"), (-0.00001, "0.0"), (1.0, "100.0"), (None, "–")]
)
def test_shares_are_written_in_per_cent(share: float | None, text: str) -> None:
    assert percent(share) == text


def test_differences_have_a_sign_and_zero_has_none_to_lose() -> None:
    assert points(0.213) == "+21.3"
    assert points(-0.013) == "−1.3"
    assert points(-0.0001) == "+0.0"
    assert signed_m(-1.111) == "−1.11 m"
    assert metres(None) == "–"


@pytest.mark.parametrize(
    ("given", "text"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_lists_are_joined_as_people_do(given: list[str], text: str) -> None:
    assert (joined(given) if given else "") == text


def test_faults_are_named_with_the_number_that_sets_them() -> None:
    assert fault_words(faults("demo")) == "50 ms trigger offset and 1.1 deg vibration"
    assert fault_words(faults("motion.road=C")) == "a road of ISO class C"
    bump = "motion.road={events: [{kind: bump, at_m: 30, height_m: 0.08, length_m: 0.9}]}"
    assert fault_words(faults(bump)) == "a smooth road with 1 event"


def test_every_pipeline_that_is_installed_has_plain_words_of_its_own() -> None:
    ours = [name for name in pipeline_names() if ":" not in name]
    assert set(OURS) - {ORACLE} == set(ours) and len(ours) == 9
    for words in ("name", "short", "takes"):
        assert len({getattr(OURS[name], words) for name in OURS}) == len(OURS)
    for plain in OURS.values():
        assert len(plain.short) <= 14 and len(plain.name) <= 30
        assert plain.takes.endswith(".") and "_" not in plain.name + plain.short + plain.takes


def test_our_pipelines_have_plain_names_and_a_users_keeps_its_own() -> None:
    assert pipeline_words("probabilistic") == "six steps"
    assert pipeline_words("mine.py:Best") == "mine.py:Best"
    assert len(pipeline_words("package.module:AVeryLongClassNameIndeed", short=True)) <= 14


@pytest.mark.parametrize(
    ("n", "text"), [(1, "n = 1 run: illustration"), (2, "n = 2 runs: illustration"), (6, "n = 6 runs")]
)
def test_few_runs_are_called_an_illustration(n: int, text: str) -> None:
    assert runs_words(groups_of([result(seed) for seed in range(n)])) == text


def test_the_sentence_says_cost_recovery_and_n_with_the_numbers_of_the_rows() -> None:
    tpr = {(): (0.80, 0.90), ("demo",): (0.60, 0.85)}
    results = [
        result(s, errors=e, tpr={"static_projection": [a] * 4, "probabilistic": [b] * 4})
        for s in (0, 1)
        for e, (a, b) in tpr.items()
    ]
    (group,) = groups_of(results)
    text = sentence([group]).replace("\N{NO-BREAK SPACE}", " ")
    assert text.startswith("50 ms trigger offset and 1.1 deg vibration cost the raw box 20.0 points of TPR")
    assert "(80.0 → 60.0 %)" in text
    assert "85.0 % on the car (+25.0; 90.0 % without the errors" in text
    x = mean_of_runs(group, "faulted", "static_projection", "mae_m.raw")
    y = mean_of_runs(group, "faulted", "probabilistic", "mae_m.raw")
    assert f"position error {metres(x)} → {metres(y)} m" in text
    assert text.endswith("n = 2 runs: illustration.")


@pytest.mark.parametrize(
    ("car", "wearable", "start"),
    [
        (0.6, 0.7, "cost the raw box 20.0 points of TPR on the car (80.0 → 60.0 %) and 10.0 points"),
        (0.6, 0.9, "cost the raw box 20.0 points of TPR on the car (80.0 → 60.0 %) and gave it 10.0"),
        (0.9, 0.6, "gave the raw box 10.0 points of TPR on the car (80.0 → 90.0 %) and cost it 20.0"),
        (0.8, 0.9, "cost the raw box 0.0 points of TPR on the car (80.0 → 80.0 %) and gave it 10.0"),
    ],
)
def test_a_gain_is_not_called_a_cost(car: float, wearable: float, start: str) -> None:
    results = [
        result(system=system, errors=errors, tpr={"static_projection": [value if errors else 0.8] * 4})
        for system, value in (("car", car), ("wearable", wearable))
        for errors in ((), ("demo",))
    ]
    text = sentence(groups_of(results)).replace("\N{NO-BREAK SPACE}", " ")
    assert text.startswith(f"50 ms trigger offset and 1.1 deg vibration {start}"), text


def test_stamps_that_are_late_by_themselves_are_said() -> None:
    late, early = (load_sensor(name) for name in ("camera-78deg-usb", "camera-40deg"))
    assert isinstance(late, CameraSensor) and isinstance(early, CameraSensor)
    assert "at least 20 to 100 ms after" in stamp_words([early, late])
    assert "at least 30 ms after" in stamp_words([late.model_copy(update={"stamp_delay_ms": 30.0})])
    assert stamp_words([early]) == "" and stamp_words([]) == ""


def test_the_sentence_is_one_sentence_in_every_situation() -> None:
    clean, bad = result(), result(errors=("demo",))
    void = replace(bad, cases=())
    situations = [
        [clean],
        [bad],
        [clean, bad],
        [without_target()],
        [clean, void],
        [result(crash=PIPELINES)],
        [clean, result(errors=("demo",), crash=PIPELINES)],
        [result(system=s, errors=e) for s in ("car", "wearable") for e in ((), ("demo",))],
    ]
    for given in situations:
        text = sentence(groups_of(given))
        assert text.endswith(".") and not re.search(r"\.\s+[A-Z]", text), text
        assert "None" not in text and "nan" not in text
