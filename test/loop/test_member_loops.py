import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.loop.member_loops import MemberLoop, Wiring, read_member_loops

CASCADE = LoopModel.load(find_config("cascade.loop.yaml"))
LOOPS = read_member_loops(["LC1: F1.SP -> L1", "FC1: FV1 -> F1"], CASCADE, "here")


def test_a_loop_is_read_with_its_tags() -> None:
    assert [MemberLoop("LC1", ("F1.SP",), ("L1",)), MemberLoop("FC1", ("FV1",), ("F1",))] == LOOPS
    (both,) = read_member_loops(["U1: FV1 -> F1, L1"], CASCADE, "here")
    assert both.outputs == ("F1", "L1")


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        (["FC1 FV1"], "is no loop"),
        (["FC1: FV2 -> F1"], "FV2 is not of the plant"),
        (["FC1: FV1 -> F2"], "F2 is not of the plant"),
        (["FC1: FV1 -> F1", "FC2: FV1 -> L1"], "FV1 belongs to two loops"),
        (["LC1: F1.SP -> L1"], "nobody moves FV1"),
    ],
)
def test_what_is_no_loop_of_the_plant_is_refused(entries: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_member_loops(entries, CASCADE, "here")


def test_the_op_of_an_outer_loop_is_the_next_set_point_of_the_inner_one() -> None:
    wiring, scheduled = Wiring(CASCADE, LOOPS), np.array([40.0, 51.0])
    assert wiring.op_of(LOOPS[0]).tolist() == [50.0]
    assert wiring.set_points(scheduled).tolist() == [50.0, 51.0]
    assert wiring.take([np.array([47.0]), np.array([60.0])]).tolist() == [60.0]
    assert wiring.set_points(scheduled).tolist() == [47.0, 51.0]
    assert wiring.of(LOOPS[0], scheduled).tolist() == [51.0]


def test_one_loop_of_all_tags_changes_nothing() -> None:
    whole = MemberLoop("", CASCADE.valve_names, CASCADE.outputs)
    wiring, scheduled = Wiring(CASCADE, [whole]), np.array([40.0, 51.0])
    assert wiring.set_points(scheduled).tolist() == scheduled.tolist()
    assert wiring.take([np.array([60.0])]).tolist() == [60.0]
