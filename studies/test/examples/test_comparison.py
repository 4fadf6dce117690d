"""True against identified, and what many seeds say together."""

import dataclasses
import json

import pytest
from known_answers import moved, perfect

from stiction_studies.examples import Example, compare, example1, healthy_loop, tally
from stiction_studies.examples.comparison import Against, identified_process


@pytest.fixture(scope="module")
def example() -> Example:
    return example1(1)


def test_the_truth_has_no_errors(example: Example) -> None:
    comparison = compare(example, perfect(example))
    assert comparison.stem_error == 0.0
    assert comparison.square_error == comparison.true_stem_square_error
    (valve,), (channel,) = comparison.valves, comparison.channels
    assert (valve.static_friction.error, valve.dynamic_friction.error) == (0.0, 0.0)
    assert valve.static_friction.inside
    assert (channel.delay.error, channel.gain.error) == (0, pytest.approx(0.0, abs=1e-9))
    assert channel.response_error < 1e-9


def test_stem_error_is_that_of_remark_2(example: Example) -> None:
    found = perfect(example)
    stem = found.stem + 0.5
    comparison = compare(example, dataclasses.replace(found, stem=stem))
    assert comparison.stem_error == pytest.approx(0.25 * 2500)


def test_a_wrong_delay_shows_in_the_step_response(example: Example) -> None:
    (channel,) = compare(example, moved(perfect(example), 0.0, delay=2)).channels
    assert (channel.delay.true, channel.delay.found) == (5, 7)
    assert 0.02 < channel.response_error < 0.2


def test_a_wrong_delay_has_the_larger_square_error(example: Example) -> None:
    comparison = compare(example, moved(perfect(example), 0.0, delay=4))
    assert comparison.square_error > 1.5 * comparison.true_stem_square_error


def test_step_responses_end_at_the_gain(example: Example) -> None:
    model = identified_process(perfect(example))
    response = model.step_responses(400)
    assert response[:6].max() == 0.0
    assert response[6, 0, 0] == pytest.approx(0.002445)
    assert response[-1] == pytest.approx(model.gain, rel=1e-6)


def test_inside_counts_the_ends() -> None:
    assert Against(1.0, 1.2, (1.0, 1.3)).inside is True
    assert Against(1.0, 1.2, (1.1, 1.3)).inside is False
    assert Against(1.0, 1.2).inside is None


def test_json_is_plain(example: Example) -> None:
    document = compare(example, perfect(example)).to_dict()
    assert json.loads(json.dumps(document)) == document
    assert document["valves"][0]["f_s"].keys() == {"true", "found", "error", "interval", "inside"}


def test_tally_of_example1_counts_what_is_right(example: Example) -> None:
    good = compare(example, perfect(example))
    late = compare(example, moved(perfect(example), 0.0, delay=1))
    far = compare(example, moved(perfect(example), 0.11))
    delay, close, static, dynamic, sticky = tally("example1", [good, good, late, far])
    assert (delay.count, close.count) == (3, 3)
    assert (static.count, dynamic.count, sticky.count) == (4, 4, 4)
    assert str(delay) == "delay right: 3 of 4 (wanted 99 %: not met)"
    assert static.met is True


def test_tally_of_example2_asks_for_a_healthy_second_valve(example: Example) -> None:
    first = compare(example, perfect(example)).valves[0]
    static = Against(8.0, 8.14, (8.0, 8.2))
    dynamic = Against(1.0, 0.86, (0.9, 1.0))
    first = dataclasses.replace(first, static_friction=static, dynamic_friction=dynamic)
    low = Against(0.0, 0.3, (0.0, 0.4))
    second = dataclasses.replace(first, name="V2", verdict="healthy", static_friction=low)
    both = dataclasses.replace(compare(example, perfect(example)), valves=(first, second))
    stuck = dataclasses.replace(both, valves=(first, dataclasses.replace(second, verdict="sticky")))
    findings = tally("example2", [both, stuck])
    assert [finding.count for finding in findings[:3]] == [2, 2, 1]
    assert [finding.met for finding in findings[:3]] == [True, True, False]


def test_tally_of_healthy_loops_allows_two_percent_sticky() -> None:
    loop = healthy_loop(1)
    good = compare(loop, perfect(loop))
    wrong = dataclasses.replace(
        good, valves=(dataclasses.replace(good.valves[0], verdict="sticky"),)
    )
    for bad, met in ((1, True), (2, False)):
        findings = {f.text: f for f in tally("healthy", [good] * (60 - bad) + [wrong] * bad)}
        assert findings["V1: sticky"].count == bad
        assert findings["V1: sticky"].met is met
        assert findings["V1: healthy"].count == 60 - bad
        assert findings["V1: sticky or backlash"].count == bad


def test_tally_of_healthy_loops_counts_backlash_as_friction() -> None:
    loop = healthy_loop(1)
    good = compare(loop, perfect(loop))
    kinds = ("sticky", "backlash")
    wrong = [
        dataclasses.replace(good, valves=(dataclasses.replace(good.valves[0], verdict=kind),))
        for kind in kinds
    ]
    findings = {f.text: f for f in tally("healthy", [good] * 58 + wrong)}
    assert [findings[f"V1: {kind}"].met for kind in kinds[:1]] == [True]
    assert findings["V1: sticky or backlash"].count == 2
    assert findings["V1: sticky or backlash"].met is False
