"""When the estimator fits a window, and when its result takes effect."""

import dataclasses

from stiction_ros.errors import InputError
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class FitSchedule:
    """Shared by estimator and controller, so that a run does not depend on speed.

    Sample numbers count from 0 at the first measurement. A window that ends at sample k is
    fitted for k + 1 = ``fit_first``, ``fit_first`` + ``fit_every``, …; its result takes effect
    at sample k + ``fit_latency``.
    """

    fit_first: int = setting(1000, "samples before the first fit", low=1)
    fit_every: int = setting(250, "samples between two fits", low=1)
    fit_latency: int = setting(5, "samples from the end of a window to its effect", low=1)

    def check_latency(self) -> None:
        """Raise InputError where the next window ends before a fit takes effect."""
        if self.fit_every < self.fit_latency:
            raise InputError(
                f"{self.fit_every} is less than fit_latency = {self.fit_latency}",
                where="fit_every",
                fix="a fit must take effect before the next window ends",
            )

    def due(self, sample: int) -> bool:
        """Return whether the window that ends at ``sample`` is fitted."""
        beyond = sample + 1 - self.fit_first
        return beyond >= 0 and beyond % self.fit_every == 0

    def awaited(self, sample: int) -> int | None:
        """Return the last sample of the window whose result takes effect at ``sample``."""
        end = sample - self.fit_latency
        return end if self.due(end) else None
