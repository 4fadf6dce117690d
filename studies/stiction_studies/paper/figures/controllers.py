"""Figure 6: the three formulations of MPC on Example 2, on both plants."""

from stiction_studies.examples.control_study import COLUMNS, StudyOptions, run_trial
from stiction_studies.pages.control_report import PLANT_TITLES, PlantStudy, figures_of
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources

CLAIMS = {
    "unaware": ("cycles", "with the weights of the scenario; the printed ones are very slow"),
    "inversion": ("cycles as well", ""),
    "printed": ("negligible offsets, as good as SU without friction", "in part: docs/paper.md"),
    "exact": ("", "not in the paper: its programme solved exactly, with the package's weights"),
    "free": ("", "what the paper compares with"),
}


def figure6(sources: Sources, plant: str) -> Exhibit:
    """Return the comparison on one plant.

    Args:
        sources: for the seed.
        plant: ``linear`` is (A.3), ``tank`` is (A.1).
    """
    options = StudyOptions(plant, schedule="scenario")
    study = PlantStudy.of([run_trial(options, sources.seed)])
    rows = []
    for column in COLUMNS:
        score = study.means()[column.key]
        claim, remark = CLAIMS[column.key]
        outputs = ", ".join(
            f"{tag}: IAE {one.iae:.3g}, offset {one.offset:.2g}, cycle {one.amplitude:.2g}"
            for tag, one in score.outputs.items()
        )
        valve, moved = next(iter(score.valves.items()))
        work = f"{valve}: travel {moved.travel:.0f} %"
        if column.sticky:
            work += f", {moved.moves:.0f} moves"
        rows.append(Row(column.title, claim, f"{outputs}; {work}", remark))
    remark = (
        "All controllers know the true friction. IAE in units of PV × min; offset, IAE and cycle "
        "of the noise-free outputs."
    )
    title = f"Figure 6 on {PLANT_TITLES[plant]}"
    return Exhibit("figure6", title, tuple(rows), figures_of(study), remark)
