"""Self-contained HTML reports, their figures, and the scores of a run.

- :mod:`.scoring`, :mod:`.story`, :mod:`.summary`: figures of merit and ``summary.json``;
  they draw nothing and import no plotting library.
- :mod:`.run_report`: the report of a run from its bag (or, by :mod:`.live_log`, of a loop that
  ran without ROS); :mod:`.record_report`: the report of one identified record.
"""
