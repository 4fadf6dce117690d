import types

from stiction_ros.records.bag.messages import BagMessage
from stiction_ros.records.run.events import answer_times


def told(**values: str) -> BagMessage:
    items = [types.SimpleNamespace(key=key, value=value) for key, value in values.items()]
    status = types.SimpleNamespace(name="plant: status", values=items)
    header = types.SimpleNamespace(stamp=types.SimpleNamespace(sec=0, nanosec=0))
    message = types.SimpleNamespace(header=header, status=[status])
    return BagMessage("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 0, 0, message)


def test_the_last_figures_are_those_of_the_whole_run() -> None:
    names = ("p50", "p99", "p999", "max")
    early = told(**{f"pv_to_op_ms_{name}": "1.0" for name in names})
    last = told(**{f"pv_to_op_ms_{name}": str(2.0 + k) for k, name in enumerate(names)})
    broken = told(pv_to_op_ms_p50="soon", pv_to_op_ms_max="9.0")
    found = answer_times([early, last, broken, told(sample="3")])
    assert found == {"p50": 2.0, "p99": 3.0, "p999": 4.0, "max": 5.0}


def test_a_run_in_lockstep_has_none() -> None:
    assert answer_times([told(sample="3")]) == {}
