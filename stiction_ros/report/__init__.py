"""Self-contained HTML reports, their figures, and the scores of a run.

- :mod:`.run.scoring`, :mod:`.run.story`, :mod:`.run.summary`: figures of merit and
  ``summary.json``; they draw nothing and import no plotting library.
- :mod:`.run.report`: the report of a run from its bag (or, by :mod:`.run.live_log`, of a loop that
  ran without ROS); :mod:`.record.report`: the report of one identified record.
"""
