"""The handshake: asked, granted, and lost at the first doubt."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.opcua.grant import Grant, GrantState, begin

Facts = tuple[bool, str]  # whether the mode grants it, and what speaks against it
WELL: Facts = (False, "")
GRANTED: Facts = (True, "")


def granted() -> Grant:
    return begin(True).ask().follow(*WELL).follow(*GRANTED)


def test_listening_is_for_good() -> None:
    grant = begin(False).ask()
    assert grant.follow(*GRANTED).state is GrantState.LISTENING
    assert grant.give_back("stop").state is GrantState.LISTENING


def test_asked_and_granted() -> None:
    asked = begin(True).ask().follow(*WELL)
    assert asked.state is GrantState.ASKED
    assert asked.requesting
    assert not asked.may_write
    grant = asked.follow(*GRANTED)
    assert grant.may_write


def test_nothing_is_asked_for_unasked() -> None:
    grant = begin(True)
    assert not grant.give_back("the node stops").lost
    assert grant.follow(*WELL) == grant
    assert grant.follow(*GRANTED) == grant


@pytest.mark.parametrize("facts", [(False, ""), (True, "no connection")])
def test_a_grant_is_lost_at_once_and_not_asked_for_again(facts: Facts) -> None:
    lost = granted().follow(*facts)
    assert lost.state is GrantState.IDLE
    assert lost.reason
    assert lost.lost
    assert not lost.ask().lost
    assert lost.follow(True).state is GrantState.IDLE
    assert lost.follow(False).state is GrantState.IDLE


@pytest.mark.parametrize("facts", [(False, "no op"), (True, "")])
def test_it_waits_with_asking_until_nothing_speaks_against_it(facts: Facts) -> None:
    grant = begin(True).ask().follow(*facts)
    assert grant.state is GrantState.IDLE
    assert grant.wanted
    assert grant.follow(*WELL).state is GrantState.ASKED


FACTS = st.tuples(st.booleans(), st.sampled_from(("", "fault")))


@given(st.lists(st.one_of(FACTS, st.sampled_from(("ask", "give back")))))
def test_whatever_happens_nothing_is_written_that_is_not_granted_now(steps: list[object]) -> None:
    grant = begin(True)
    for step in steps:
        if isinstance(step, tuple):
            before, grant = grant, grant.follow(*step)
            if grant.may_write:
                assert step == (True, "")
                assert before.requesting
        else:
            grant = grant.ask() if step == "ask" else grant.give_back("told to")
            assert not grant.may_write or step == "ask"
