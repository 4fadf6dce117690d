"""The log time of a recorder: simulated where there is such a time, and never backwards."""

AGAIN = 10  # older times in succession, increasing, after which time is taken to have begun anew
SIMULATED = "stiction_simulated_time"  # metadata record with the first simulated time


class LogTime:
    """Gives each message its log time, ns: that of reception until a simulated one is known.

    Simulated time that falls back is passed over; when it goes on from there, as after a restart of
    a plant, log time goes on with it from where it stood.
    """

    def __init__(self) -> None:
        self._last = 0
        self._offset = 0
        self._simulated = False
        self._older: list[int] = []

    def see(self, stamp: int) -> bool:
        """Take a simulated time in ns; tell whether it is the first one."""
        first = not self._simulated
        if first:
            self._simulated, self._last = True, stamp
        elif stamp + self._offset >= self._last:
            self._last = stamp + self._offset
            self._older.clear()
        else:
            self._begin_anew(stamp)
        return first

    def of(self, received: int) -> int:
        """Return the log time of a message that was received at ``received``, ns."""
        if not self._simulated:
            self._last = max(self._last, received)
        return self._last

    def _begin_anew(self, stamp: int) -> None:
        if self._older and stamp <= self._older[-1]:
            self._older.clear()
        self._older.append(stamp)
        if len(self._older) >= AGAIN:
            self._offset = self._last - self._older[0]
            self._last = stamp + self._offset
            self._older.clear()
