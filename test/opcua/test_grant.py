"""The handshake: asked, granted, and lost at the first doubt."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.opcua.grant import Grant, GrantState, begin

Facts = tuple[float, bool, str]  # s, whether the mode grants it, and what speaks against it
WELL: Facts = (1.0, False, "")
GRANTED: Facts = (2.0, True, "")


def granted() -> Grant:
    return begin(0.0, True).ask().follow(*WELL).follow(*GRANTED)


def test_listening_is_for_good() -> None:
    grant = begin(0.0, False).ask()
    assert grant.follow(*GRANTED).state is GrantState.LISTENING
    assert grant.give_back(1.0, "stop").state is GrantState.LISTENING


def test_asked_and_granted() -> None:
    asked = begin(0.0, True).ask().follow(*WELL)
    assert asked.state is GrantState.ASKED
    assert asked.requesting
    assert not asked.may_write
    grant = asked.follow(*GRANTED)
    assert grant.may_write
    assert grant.since == 2.0


def test_nothing_is_asked_for_unasked() -> None:
    grant = begin(0.0, True)
    assert not grant.give_back(1.0, "the node stops").lost
    assert grant.follow(*WELL) == grant
    assert grant.follow(*GRANTED) == grant


@pytest.mark.parametrize("facts", [(3.0, False, ""), (3.0, True, "no connection")])
def test_a_grant_is_lost_at_once_and_not_asked_for_again(facts: Facts) -> None:
    lost = granted().follow(*facts)
    assert lost.state is GrantState.IDLE
    assert lost.reason
    assert lost.lost
    assert not lost.ask().lost
    assert lost.follow(4.0, True).state is GrantState.IDLE
    assert lost.follow(4.0, False).state is GrantState.IDLE


@pytest.mark.parametrize("facts", [(1.0, False, "no op"), (1.0, True, "")])
def test_it_waits_with_asking_until_nothing_speaks_against_it(facts: Facts) -> None:
    grant = begin(0.0, True).ask().follow(*facts)
    assert grant.state is GrantState.IDLE
    assert grant.wanted
    assert grant.follow(*WELL).state is GrantState.ASKED


FACTS = st.tuples(st.just(0.0), st.booleans(), st.sampled_from(("", "fault")))


@given(st.lists(st.one_of(FACTS, st.sampled_from(("ask", "give back")))))
def test_whatever_happens_nothing_is_written_that_is_not_granted_now(steps: list[object]) -> None:
    grant = begin(0.0, True)
    for step in steps:
        if isinstance(step, tuple):
            before, grant = grant, grant.follow(*step)
            if grant.may_write:
                assert step[1:] == (True, "")
                assert before.requesting
        else:
            grant = grant.ask() if step == "ask" else grant.give_back(0.0, "told to")
            assert not grant.may_write or step == "ask"
