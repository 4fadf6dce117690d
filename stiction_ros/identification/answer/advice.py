"""What goes with every answer, whichever method gave it: what would decide, and plausibility."""

import dataclasses

from stiction_ros.identification.answer.experiment import experiment_for
from stiction_ros.identification.answer.loop_kind import LoopKind, judged_by_kind
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.result.identification import FitStatus, Identification, VerdictKind
from stiction_ros.records.record import Record


def advised(
    record: Record, found: Identification, options: IdentificationOptions
) -> Identification:
    """Return the identification with an experiment for each undecided valve, and notes.

    Args:
        record: what was measured.
        found: what a method made of it.
        options: of the method; ``kind`` is what is known of the loop beforehand.
    """
    valves = tuple(
        dataclasses.replace(valve, experiment=experiment_for(record, found, j))
        if valve.verdict is VerdictKind.UNDECIDED
        else valve
        for j, valve in enumerate(found.valves)
    )
    told = () if options.kind is None else _by_kind(record, found, LoopKind(options.kind))
    return dataclasses.replace(found, valves=valves, notes=(*found.notes, *told))


def _by_kind(record: Record, found: Identification, kind: LoopKind) -> tuple[str, ...]:
    """Return a sentence for each output on the valve that moves it most."""
    if found.status is not FitStatus.OK:
        return ()
    told = []
    for model in found.outputs:
        answers = [
            StepAnswer.of(model, valve, len(record), record.sample_time)
            for valve, taps in model.b.items()
            if any(taps)
        ]
        if answers:
            strongest = max(answers, key=lambda answer: answer.clearness)
            told.append(judged_by_kind(kind, strongest)[1])
    return tuple(told)
