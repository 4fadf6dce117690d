"""What would service bring, and what slower tuning? Simulated before anybody is sent.

For maintenance planners. The loop model may be one that was identified.
"""

import numpy as np

from stiction_ros import LoopModel, Record, SetPoints, find_config, simulate


def scores(record: Record) -> tuple[float, float]:
    """Return ∫|SP − PV| dt per hour, and the travel of the stem in % per hour."""
    assert record.sp is not None
    assert record.stem is not None
    hours = len(record) * record.sample_time / 3600.0
    error = np.abs(record.sp - record.pv).sum() * record.sample_time
    return float(error / hours), float(np.abs(np.diff(record.stem, axis=0)).sum() / hours)


def slower(model: LoopModel, factor: float) -> LoopModel:
    """Return the loop with its controller's gain divided by ``factor``."""
    document = model.to_mapping()
    document["controller"]["gain"] /= factor
    return LoopModel.from_mapping(document, model.name)


def main(samples: int = 3000) -> None:
    """Compare the loop as it is with the same loop serviced, and retuned."""
    model = LoopModel.load(find_config("flow.loop.yaml"))
    moves = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
    for name, loop in (
        ("as it is", model),
        ("serviced", model.with_ideal_valves()),
        ("gain halved", slower(model, 2.0)),
    ):
        error, travel = scores(simulate(loop, moves, samples))
        print(f"{name:12}  error {error:6.0f} per hour   travel {travel:6.0f} % per hour")


if __name__ == "__main__":
    main()
