"""Fault specs and sets: laws of override, off is never mentioned, bad input, severities."""

from __future__ import annotations

from math import ceil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput, Where
from scenarios.fault_set import (
    FaultChange,
    FaultSet,
    describe_faults,
    list_fault_sets,
    load_fault_set,
    parse_fault_arguments,
    parse_faults,
)
from scenarios.faults import FAULTS, EdgeError, RoadShake, Trace, TriggerOffset, Vibration
from scenarios.severity import SEVERITIES, Severity, road_class, severe

FILE = Where(file="f.yaml")
LEVELS = (0, 0.25, 0.5, 1)


def strength(name: str, number: float) -> float | str:
    """That much of a fault: the number, or a word where its strength is one; a file or none of a trace."""
    if name == Trace.name:
        return "gyro.csv" if number else ""
    words = FAULTS[name].strength_words()
    if words:
        return words[LEVELS.index(number)]
    whole = FAULTS[name].model_fields[FAULTS[name].strength].annotation is int
    return ceil(number) if whole else number


# Plain inputs, parsed inside the tests: type checks draw at random, which a strategy must not.
SETS = st.dictionaries(st.sampled_from(sorted(FAULTS)), st.sampled_from([0, 0.0, 0.5, 1]), max_size=5).map(
    lambda numbers: {name: strength(name, number) for name, number in numbers.items()}
)
CHANGES = st.lists(
    st.one_of(
        st.just("none"),
        st.just("demo"),
        st.tuples(st.sampled_from(sorted(FAULTS)), st.sampled_from([0, 0.25, 1])).map(
            lambda p: p[0] + "=" + (str(strength(*p)) or '""')
        ),
    ),
    max_size=4,
)

NOTHING = FaultChange()
CLEAR = FaultChange(clears=True)

Raw = dict[str, float | str]


@given(raw=SETS)
def test_no_change_changes_nothing_and_none_clears(raw: Raw) -> None:
    base = parse_faults(raw, FILE)
    assert base.override(NOTHING) == base and base.override(NOTHING).label == base.label
    assert base.override(CLEAR) == FaultSet() and base.override(CLEAR).label == "none"


@given(raw=SETS, arguments=CHANGES)
def test_a_change_made_twice_is_a_change_made_once(raw: Raw, arguments: list[str]) -> None:
    base, change = parse_faults(raw, FILE), parse_fault_arguments(arguments)
    assert base.override(change).override(change) == base.override(change)


@given(raw=SETS, first=CHANGES, second=CHANGES)
def test_two_changes_in_a_row_are_their_combination(raw: Raw, first: list[str], second: list[str]) -> None:
    base, a, b = parse_faults(raw, FILE), parse_fault_arguments(first), parse_fault_arguments(second)
    assert base.override(a).override(b) == base.override(a.then(b))
    assert parse_fault_arguments(first + second) == a.then(b)


@given(first=CHANGES, second=CHANGES, third=CHANGES)
def test_combining_changes_is_associative_with_a_neutral_one(
    first: list[str], second: list[str], third: list[str]
) -> None:
    a, b, c = (parse_fault_arguments(arguments) for arguments in (first, second, third))
    assert a.then(b).then(c) == a.then(b.then(c))
    assert NOTHING.then(a) == a == a.then(NOTHING)


@given(raw=SETS, arguments=CHANGES)
def test_a_change_replaces_its_own_keys_and_leaves_the_others(raw: Raw, arguments: list[str]) -> None:
    base, change = parse_faults(raw, FILE), parse_fault_arguments(arguments)
    after = {spec.name: spec for spec in base.override(change)}
    for spec in change.specs:
        assert after.pop(spec.name, None) == (None if spec.is_off else spec)
    before = {} if change.clears else {spec.name: spec for spec in base}
    assert after == {name: before[name] for name in before if name not in {s.name for s in change.specs}}


@given(raw=SETS)
def test_a_fault_that_is_off_is_as_if_never_mentioned(raw: Raw) -> None:
    without = {name: value for name, value in raw.items() if value not in (0, "smooth", "none", "")}
    found = parse_faults(raw, FILE)
    assert found == parse_faults(without, FILE)
    assert [spec.name for spec in found] == sorted(without)
    assert not any(spec.is_off for spec in found)


@given(raw=SETS)
def test_a_set_is_read_back_from_its_own_data(raw: Raw) -> None:
    base = parse_faults(raw, FILE)
    assert parse_faults(base.as_data(), FILE) == base


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_a_bare_value_sets_the_strength_and_the_least_is_off(name: str) -> None:
    kind, some = FAULTS[name], strength(name, 0.5)
    bare, full = parse_faults({name: some}, FILE), parse_faults({name: {kind.strength: some}}, FILE)
    assert bare == full and getattr(bare.specs[0], kind.strength) == some
    assert len(parse_faults({name: strength(name, 0)}, FILE)) == 0
    assert (
        kind.name == name and (kind.__doc__ or "").count("Unit:") == 1 and "Source:" in (kind.__doc__ or "")
    )


@pytest.mark.parametrize("severity", SEVERITIES, ids=lambda s: f"{s.fault}-{s.profile}")
def test_every_severity_can_be_asked_for_by_its_number(severity: Severity) -> None:
    profile = severity.profile or "car"
    specs = [parse_fault_arguments([f"{severity.fault}@{level}"], profile).specs for level in range(1, 6)]
    assert [spec for (spec,) in specs] == [severe(severity.fault, level, profile) for level in range(1, 6)]
    assert len({repr(spec) for spec in specs}) == 5


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("timing.trigger_offset_ms@6", ("severity 6", "1 to 5")),
        ("timing.trigger_offset_ms@0", ("severity 0", "1 to 5")),
        ("timing.trigger_offset_ms@x", ("'x'", "1 to 5")),
        ("timing.triger_offset_ms@3", ("did you mean 'timing.trigger_offset_ms'?",)),
    ],
)
def test_a_severity_that_is_not_there_costs_one_sentence(argument: str, words: tuple[str, ...]) -> None:
    with pytest.raises(BadInput) as error:
        parse_fault_arguments([argument])
    assert all(word in str(error.value) for word in words), str(error.value)


def test_jitter_or_bias_alone_is_not_off() -> None:
    assert not TriggerOffset(jitter_ms=1.0).is_off
    assert not EdgeError(sd_fraction=0.0, bias_fraction=-0.1).is_off
    assert TriggerOffset(sensors=("cam",)).is_off


def test_the_set_of_a_class_is_found_by_the_class() -> None:
    faults = parse_faults({"motion.vibration_deg": 0.5}, FILE)
    found = faults.get(Vibration)
    assert found is not None and found.rms_deg == 0.5 and found.heave_m_per_deg == 0.02
    assert faults.get(TriggerOffset) is None


def test_the_demo_has_a_trigger_offset_of_50_ms_and_a_named_road() -> None:
    demo = FaultSet().override(parse_fault_arguments(["demo"]))
    offset, vibration = demo.get(TriggerOffset), demo.get(Vibration)
    assert demo.label == "demo" and len(demo) == 2
    assert offset is not None and (offset.offset_ms, offset.sensors) == (50.0, "cameras")
    assert vibration is not None and road_class(vibration.rms_deg, "car") == "E"
    assert "demo" in list_fault_sets()


def test_arguments_are_read_in_their_order() -> None:
    change = parse_fault_arguments(["demo", "timing.trigger_offset_ms={offset_ms: 5, jitter_ms: 1}"])
    offset = FaultSet().override(change).get(TriggerOffset)
    assert offset is not None and (offset.offset_ms, offset.jitter_ms) == (5.0, 1.0)
    assert change.label == "demo+timing.trigger_offset_ms={offset_ms: 5, jitter_ms: 1}"
    assert parse_fault_arguments(["demo", "none"]) == CLEAR
    assert parse_fault_arguments(["none", "demo"]).label == "demo"


def test_a_fault_set_may_be_a_file(tmp_path: Path) -> None:
    path = tmp_path / "late.yaml"
    path.write_text("description: Late\nfaults:\n  timing.trigger_offset_ms: 30\n")
    change = load_fault_set(str(path))
    assert change.label == "late" and change.specs == (TriggerOffset(offset_ms=30.0),)
    path.write_text("faults:\n  motion.flex_deg: 1\n  motion.flx_deg: 1\n")
    with pytest.raises(BadInput, match=r"late.yaml, line 3, faults.motion.flx_deg: unknown fault"):
        load_fault_set(str(path))
    path.write_text("fault: {}\n")
    with pytest.raises(BadInput, match="a fault set is a mapping with 'faults'"):
        load_fault_set(str(path))
    path.write_text("faults: {}\nseverity: 3\n")
    with pytest.raises(BadInput, match="line 2, severity: unknown key"):
        load_fault_set(str(path))


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("demmo", "did you mean 'demo'?"),
        ("motion.flex_deg", "needs a value, as in motion.flex_deg=1"),
        ("motion.flex_deg=", "needs a value"),
        ("motion.flex=1", "did you mean 'motion.flex_deg'?"),
        ("motion.flex_deg=nan", "not finite"),
        ("motion.flex_deg=.inf", "not finite"),
        ("motion.flex_deg=much", "must be a number, is 'much'"),
        ("motion.flex_deg=true", "must be a number or a mapping, is true"),
        ("motion.flex_deg=[1]", "must be a number or a mapping, is a list"),
        ("motion.flex_deg=null", "must be a number or a mapping, is null"),
        ("motion.flex_deg=-0.1", "rms_deg: must not be negative, is -0.1"),
        ("motion.flex_deg={rms: 1}", "did you mean 'rms_deg'?"),
        ("motion.flex_deg={rms_deg: 1", "not YAML"),
        ("motion.flex_deg={stiffness: sof}", "did you mean 'soft'?"),
        ("motion.flex_deg={sensors: cam-front}", "allowed: cameras, lidar or a list"),
        ("motion.flex_deg={sensors: []}", "names no camera"),
        ("motion.flex_deg={sensors: [a, a]}", "names a camera twice"),
        ("motion.flex_deg={uniform: [1, 2]}", "unknown key 'uniform'"),
        ("motion.road", "needs a value, as in motion.road=E"),
        ("motion.road=c", "did you mean 'C'?"),
        ("motion.road=F", "allowed: smooth, A, B, C, D, E"),
        ("motion.road=3", "allowed: smooth, A, B, C, D, E"),
        ("motion.road=true", "must be one of smooth, A, B, C, D, E or a mapping, is true"),
        ("motion.road={events: [{kind: bump, at_m: 9, height_m: 0.1}]}", "'length_m' is missing"),
        ("motion.road={events: [{kind: hole, at_m: 9, height_m: 0.1, length_m: 1}]}", "allowed: bump, kerb"),
        ("motion.road={events: [{kind: kerb, at_m: 9, height_m: 3, length_m: 1}]}", "must be <= 0.3, is 3"),
        ("motion.road={events: [{kind: kerb, at_m: 9, height_m: 0, length_m: 1}]}", "must be > 0, is 0"),
        ("timing.trigger_offset_ms=1001", "must be <= 1000"),
        ("timing.trigger_offset_ms={jitter_ms: -1}", "jitter_ms: must not be negative"),
        ("calibration.rotation_deg={axis: up}", "allowed: random, roll, pitch, yaw"),
        ("detector.edge_error={tau_s: -1}", "tau_s: must not be negative"),
        ("lidar.dropout_percent=101", "percent: must be <= 100, is 101"),
        ("lidar.dropout_weak={percent: 5, width: 0}", "width: must be >= 0.001"),
        ("lidar.beam_loss=100", "must be <= 99"),
        ("lidar.range_noise_cm=-1", "sd_cm: must not be negative"),
        ("lidar.azimuth_error_deg={eccentricity_deg: -1}", "eccentricity_deg: must not be negative"),
        ("lidar.dirt_sector={width_deg: 10, opacity: 0}", "opacity: must be > 0"),
        ("lidar.dirt_sector=361", "must be <= 360"),
        ("lidar.reduced_range=100", "must be <= 99"),
        ("lidar.ghosts_percent={percent: 1, max_range_m: 1}", "max_range_m: must be >= 5"),
        ("lidar.fog_mor_m=-50", "mor_m: must not be negative"),
        ("lidar.rain_mmph=heavy", "must be a number"),
        ("away/faults.yaml", "away/faults.yaml: no such file"),
        ("", "is empty"),
    ],
)
def test_a_bad_argument_is_refused_in_one_sentence(argument: str, says: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_fault_arguments([argument])
    assert says in str(caught.value) and str(caught.value).isprintable()
    assert "pydantic" not in str(caught.value).lower()


def test_a_camera_that_the_rig_lacks_is_refused() -> None:
    faults = parse_faults({"motion.flex_deg": {"rms_deg": 1, "sensors": ["cam-left"]}}, FILE)
    faults.check(("cam-left", "cam-right"), FILE)
    with pytest.raises(BadInput, match=r"f.yaml, motion.flex_deg.sensors: unknown camera 'cam-left'"):
        faults.check(("cam-centre", "cam-right"), FILE)


def test_two_faults_that_shake_the_same_body_are_refused() -> None:
    both = parse_faults({"motion.road": "B", "motion.vibration_deg": 1}, FILE)
    with pytest.raises(BadInput, match=r"motion.road and motion.vibration_deg both shake the body"):
        both.check((), FILE)
    parse_faults({"motion.road": "B", "motion.vibration_deg": 0}, FILE).check((), FILE)


def test_a_smooth_road_with_a_bump_is_not_off() -> None:
    bump = {"kind": "bump", "at_m": 20.0, "height_m": 0.08, "length_m": 0.9}
    (spec,) = parse_faults({"motion.road": {"events": [bump]}}, FILE)
    assert isinstance(spec, RoadShake) and spec.roughness == "smooth" and spec.events[0].track == "both"


def test_severities_rise_and_make_valid_specs() -> None:
    for severity in SEVERITIES:
        falls = severity.fault == "lidar.fog_mor_m"  # the less one sees, the denser the fog
        assert list(severity.values) == sorted(set(severity.values), reverse=falls)
        for level, value in enumerate(severity.values, 1):
            spec = severe(severity.fault, level, severity.profile or "car")
            assert getattr(spec, spec.strength) == value and not spec.is_off
    with pytest.raises(BadInput, match="1 to 5"):
        severe("motion.flex_deg", 6)
    with pytest.raises(BadInput, match="has no severities"):
        severe("calibration.mixup", 1)


@pytest.mark.parametrize(
    ("rms_deg", "profile", "letter"),
    [
        (0.0, "car", "A"),
        (0.07, "car", "A"),
        (0.28, "car", "C"),
        (0.55, "car", "D"),
        (1.1, "car", "E"),
        (1.55, "car", "E"),
        (1.56, "car", "beyond E: stress only"),
        (2.0, "car", "beyond E: stress only"),
        (0.42, "rider", "C"),
        (2.0, "rider", "E"),
        (3.0, "rider", "beyond E: stress only"),
    ],
)
def test_a_vibration_level_has_the_road_class_that_gives_it(
    rms_deg: float, profile: str, letter: str
) -> None:
    assert road_class(rms_deg, profile) == letter  # type: ignore[arg-type]


def test_every_fault_is_listed_with_unit_fields_and_severities() -> None:
    rows = describe_faults()
    assert [row["name"] for row in rows] == sorted(FAULTS)
    trigger = next(row for row in rows if row["name"] == "timing.trigger_offset_ms")
    assert trigger["unit"] == "ms" and trigger["bare_number_sets"] == "offset_ms"
    assert trigger["fields"] == {"offset_ms": 0.0, "jitter_ms": 0.0, "sensors": "cameras"}
    assert trigger["severities"][0]["values"] == (2.0, 10.0, 30.0, 50.0, 100.0)
    assert all(row["summary"].endswith(".") for row in rows)
