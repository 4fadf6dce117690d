"""What Figure 6 leaves open: tuning, warm start and cost, and the friction that was identified."""

from collections.abc import Sequence

from stiction_ros.identification import Identification
from stiction_ros.paper.controllers.weights import ProgrammeCost, WarmStart
from stiction_ros.paper.methods import identify
from stiction_studies.examples import example2_of_one_round
from stiction_studies.examples.control_study import COLUMNS, Column, StudyOptions, run_trial
from stiction_studies.pages.control_scores import ColumnScore, cycle_period, mean_score, score_trial
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.settings import EXAMPLES
from stiction_studies.paper.sources import Sources

SEEDS = 2  # from that of the page on
MOVE_SCALES = (0.01, 0.1, 1.0, 10.0, 100.0)
HOLD = 480  # min between set-point moves: slow tunings come to their cycle
TITLES = {column.key: column.title for column in COLUMNS}


def table_of_retuning(sources: Sources) -> Exhibit:
    """Return what SU and SI do with OP moves cheaper and dearer, on (A.3)."""
    rows = []
    for scale in MOVE_SCALES:
        options = StudyOptions("linear", move_scale=scale, hold=HOLD)
        trials = [
            run_trial(options, seed, columns=_columns("unaware", "inversion"))
            for seed in _seeds(sources)
        ]
        scores = [score_trial(trial) for trial in trials]
        periods = [cycle_period(trial.runs["unaware"]) for trial in trials]
        told = ", ".join("none" if one is None else f"{one:.0f} min" for one in periods)
        for key in ("unaware", "inversion"):
            score = mean_score([one[key] for one in scores])
            rows.append(
                Row(f"{TITLES[key]}, S × {scale:g}", "cycles", _cycle(score), f"SU: {told}")
            )
    remark = (
        "Means of the seeds; amplitude at the period of SU's cycle, noise-free outputs, "
        f"a set-point move every {HOLD} min. The remark gives that period for each seed."
    )
    return Exhibit("retuning", "Retuning does not remove the cycle", tuple(rows), remark=remark)


def table_of_ablation(sources: Sources) -> Exhibit:
    """Return the printed embedding without its warm start, without its cost, without both."""
    rows = []
    for start in (WarmStart.COMPENSATION, WarmStart.NONE):
        for cost in ProgrammeCost:
            options = StudyOptions(
                "linear", warm_start=start, programme_cost=cost, schedule="scenario"
            )
            score = _mean(options, _seeds(sources), "printed")
            whole = start is not WarmStart.NONE and cost is ProgrammeCost.REVISED
            rows.append(
                Row(
                    f"warm start {start.value}, cost {cost.value}",
                    "negligible offsets" if whole else "stuck: the valve does not move",
                    _offsets(score),
                    f"the warm start itself was applied in {100 * score.from_warm_start:.0f} % "
                    "of the steps",
                )
            )
    remark = (
        "SE as printed on (A.3), set-points of the scenario, means of the seeds. None leaves "
        "OP where it is. Plain is (19a) with the weights of SU."
    )
    return Exhibit("ablation", "Warm start and cost one by one", tuple(rows), remark=remark)


def table_of_identified(sources: Sources) -> Exhibit:
    """Return Figure 6 with the friction that the nonlinear programme found, on both plants."""
    rows = []
    for plant in ("linear", "tank"):
        for seed in _seeds(sources):
            found = _identified(seed, plant)
            known = tuple((v.static_friction, v.dynamic_friction) for v in found.valves)
            told = ", ".join(f"{static:.2f} / {dynamic:.2f}" for static, dynamic in known)
            for key in ("inversion", "printed", "exact"):
                true, ours = (
                    _mean(StudyOptions(plant, known=one, schedule="scenario"), (seed,), key)
                    for one in (None, known)
                )
                rows.append(
                    Row(
                        f"{plant}, seed {seed}, {TITLES[key]}",
                        "" if key == "exact" else "as in Figure 6",
                        _offsets(ours),
                        f"f_S / f_D {told}; with the true friction: {_offsets(true)}",
                    )
                )
    remark = (
        "The record is SU's run on the same plant with the same seed; nlp at the paper's orders, M "
        "and Δu. A healthy valve that is found to stick a little is taken to stick."
    )
    return Exhibit("identified", "Figure 6 with identified friction", tuple(rows), remark=remark)


def _identified(seed: int, plant: str) -> Identification:
    example = example2_of_one_round(seed, plant)
    return identify(example.record, EXAMPLES[2].options(example, "nlp"))


def _seeds(sources: Sources) -> range:
    return range(sources.seed, sources.seed + SEEDS)


def _columns(*keys: str) -> list[Column]:
    return [column for column in COLUMNS if column.key in keys]


def _mean(options: StudyOptions, seeds: Sequence[int], key: str) -> ColumnScore:
    trials = [run_trial(options, seed, columns=_columns(key)) for seed in seeds]
    return mean_score([score_trial(trial)[key] for trial in trials])


def _cycle(score: ColumnScore) -> str:
    lines = ", ".join(f"{tag} {one.amplitude:.2g}" for tag, one in score.outputs.items())
    return f"amplitude {lines}; {next(iter(score.valves.values())).moves:.0f} moves"


def _offsets(score: ColumnScore) -> str:
    lines = ", ".join(
        f"{tag} IAE {one.iae:.3g}, offset {one.offset:.2g}" for tag, one in score.outputs.items()
    )
    valve = next(iter(score.valves.values()))
    return f"{lines}; travel {valve.travel:.0f} %, {valve.moves:.0f} moves"
