"""What watches a worker of this machine, in the run's own process: Dask's, which also survives a death at the start.

Dask's own starts a worker again that has died, unless that has not even connected for the first time: then it fails,
and all other workers with it.
"""

from __future__ import annotations

from distributed import Nanny, Status

MOST_STARTS = 5


class PatientNanny(Nanny):
    """Starts a worker again that dies while it starts, until it has died MOST_STARTS times in a row."""

    async def instantiate(self) -> Status:
        """Starts the worker; see `distributed.Nanny.instantiate`."""
        for _ in range(MOST_STARTS):
            status = await super().instantiate()
            if status == Status.running or self.status in (Status.closing, Status.closed):
                break
        return status
