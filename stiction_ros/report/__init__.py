"""Self-contained HTML reports, their figures, and the scores of a run.

- :mod:`.run.scoring`, :mod:`.run.story`, :mod:`.run.summary`: figures of merit and
  ``summary.json``; they draw nothing and import no plotting library.
- :mod:`.run.report`: the report of a run from its bag; :mod:`.record.report`: the report of one
  identified record.
"""
