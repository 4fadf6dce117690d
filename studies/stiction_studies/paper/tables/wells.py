"""Why the programme is hard: how wide the well round the truth is, and where smoothing leads."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.one_step_result import check_record, fit_outputs, friction_limits
from stiction_ros.paper.programme.friction_programme import FrictionProgramme
from stiction_ros.paper.programme.nlp import WIDTH
from stiction_ros.paper.programme.reduced_programme import Criterion, ReducedProgramme, StemTable
from stiction_ros.paper.smoothed_laws import final_smoothing, smooth_law
from stiction_studies.examples import Example
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.settings import printed_example
from stiction_studies.paper.sources import Sources
from stiction_studies.paper.success import RIGHT

APART = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # %, starts from the truth
DIRECTIONS = 10
SMOOTHINGS = (1.0, 2.0, 4.0, 8.0, 20.0, 1e4)  # 1/%
STEP = 0.25  # %, of the grid on which the least SE is sought


def table_of_wells(sources: Sources) -> Exhibit:
    """Return how both forms of the programme end near the truth, and the least SE at other τ."""
    rows = []
    for number in (1, 2):
        well = _Well(sources.example(number), number)
        rows += [well.ends(apart) for apart in APART]
        rows.append(well.valley())
    remark = (
        f"Seed {sources.seed}, true delays, {DIRECTIONS} starts round the truth of V1 for each "
        f"distance, coefficients fitted at the start. Right: within {RIGHT} %."
    )
    return Exhibit("wells", "The well round the truth", tuple(rows), remark=remark)


class _Well:
    def __init__(self, example: Example, number: int) -> None:
        self.example, self.number = example, number
        record, options = example.record, printed_example(number).options(example, "nlp")
        self.orders = check_record(record, options)
        self.limits = friction_limits(record, options)
        self.truth = np.array([example.friction(valve) for valve in record.valves])
        self.delays = tuple(
            tuple(example.delay(output, valve) for valve in record.valves)
            for output in record.outputs
        )
        self.joint = FrictionProgramme(record, self.limits, self.orders, self.delays)
        self.criterion = Criterion(StemTable(record, self.limits, self.orders), self.delays)
        self.reduced = ReducedProgramme(self.criterion)

    def ends(self, apart: float) -> Row:
        """Return how often both forms end right, and the median SE of the starts."""
        smoothing = final_smoothing(self.limits)
        joint, reduced, begun = [], [], []
        for angle in 0.3 + 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            start = self.truth.copy()
            start[0] += apart * np.array([np.cos(angle), np.sin(angle)])
            x, found = self.joint.fitted(start, smoothing)
            begun.append(found.squared_error)
            joint.append(np.array(self.joint.solve(start, smoothing, x).end))
            reduced.append(np.array(self.reduced.solve(start, WIDTH).end))
        least = self.criterion(self.truth)[0]
        return Row(
            f"Example {self.number}, starts {apart:g} % off",
            "",
            f"{self._right(joint)} right with exact derivatives, {self._right(reduced)} with "
            "slopes over a width",
            f"median SE of the starts {np.median(begun):.3g}, at the truth {least:.3g}",
        )

    def _right(self, ends: list[FloatArray]) -> str:
        right = sum(float(np.abs(end - self.truth).max()) <= RIGHT for end in ends)
        return f"{right} of {len(ends)}"

    def valley(self) -> Row:
        """Return where SE is least on a grid for other τ; the other valves are as they are."""
        record, told = self.example.record, []
        side = np.arange(0.0, self.limits[0] + 1e-9, STEP)
        points = [(static, dynamic) for static in side for dynamic in side if dynamic <= static]
        for smoothing in SMOOTHINGS:
            values = []
            for point in points:
                friction = self.truth.copy()
                friction[0] = point
                taus = np.append(smoothing, np.full(len(friction) - 1, SMOOTHINGS[-1]))
                stems = smooth_law("he").stems(record.op, friction, taus)
                found = fit_outputs(record.pv, stems, self.delays, self.orders)
                values.append(found.squared_error)
            static, dynamic = points[int(np.argmin(values))]
            told.append(f"τ = {smoothing:g}: {static:g} / {dynamic:g}")
        true = "{:g} / {:g}".format(*self.truth[0])
        return Row(
            f"Example {self.number}, least SE on a grid of {STEP:g} %, f_S / f_D of V1",
            "",
            "; ".join(told),
            f"true {true}",
        )
